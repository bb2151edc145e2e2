"""`wallride monitor`, the car in a browser. Modules in the order to read them.

page/      what the browser gets: plain ES modules and a stylesheet, no build step, nothing from elsewhere
assets     those files, read once
door       who may come in: Host, Origin and token; pure
kept_secret  that token, kept for as long as its user is logged in
messages   what a page may say; closed and strict
outbox     what waits for one page: the newest of everything, one bundle on its way; pure
driving    from a page's hands to the operator's commands: the deadman's second half; pure
history    the last minutes of a car, for a page that comes later; pure
feed       one car as the network tells it, for all pages that watch it
relay      which cars are there, and their feeds
visit      one page, from its first byte to its last: reads, sends, keeps the deadman
qr         the address as a code for a phone's camera
server     the web server and the command
"""
