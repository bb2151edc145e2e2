"""`wallride deploy user@car`: this program onto a car, over ssh alone; the car needs no internet.

`facts`, `closure` and `plan` judge and never touch anything; `ssh`, `wheelhouse` and `transfer` carry out, and
`install.sh` does the work on the car: the same script that installs there by hand.
"""
