"""`wallride monitor`, the car in a browser. Modules in the order to read them.

page/      what the browser gets: plain ES modules and a stylesheet, no build step, nothing from elsewhere
assets     those files, read once
handover   that address, handed to the browser out of other users' sight
messages   messages of a page; closed and strict
outbox     queue of one page: the newest of everything, one bundle in transit; pure
driving    operator's commands from a page's inputs: the deadman's second half; pure
history    the last minutes of a car, for a page that comes later; pure
feed       subscriptions of one car, for all pages that watch it
relay      which cars are there, and their feeds
overview   all cars at once: their rows, one e-stop for all, the race
session    one page, from its first byte to its last: reads, sends, keeps the deadman
qr         the address as a code for a phone's camera
server     the web application and the command; who may come in is decided in clients/door
"""
