"""`python -m wallride`."""

from wallride.cli import main

raise SystemExit(main())
