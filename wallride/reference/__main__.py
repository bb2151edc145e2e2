"""`python -m wallride.reference`."""

from wallride.reference import main

if __name__ == "__main__":
    main()
