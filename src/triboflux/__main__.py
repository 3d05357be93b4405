"""``python -m triboflux`` is the command ``triboflux``."""

from triboflux.cli import main

if __name__ == "__main__":
    main()
