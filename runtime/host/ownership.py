"""Who else may change a file: what decides whether this process may run its code, or believe its rights and keys."""

import grp
import os
import pwd
import stat
from pathlib import Path

_EVERY_USER = stat.S_IWOTH
_GROUP = stat.S_IWGRP


def is_root() -> bool:
    """Tell whether this process may do everything, so that what it runs must be root's alone."""
    return os.geteuid() == 0


def changed_by_others(path: Path) -> str:
    """Return who besides root and this user may change what is at a path, as a clause; "" where there is none.

    The folders above count as well, but for a sticky one, in which nothing of another user can be exchanged.
    """
    place = path.resolve()
    return next(filter(None, (_of(one, above=one != place) for one in (place, *place.parents))), "")


def _of(place: Path, *, above: bool) -> str:
    found = place.stat()
    if found.st_uid not in {0, os.geteuid()}:
        return f"{place} belongs to user {_name(found.st_uid)}"
    if above and found.st_mode & stat.S_ISVTX:
        return ""
    if found.st_mode & _EVERY_USER:
        return f"every user may write {place}"
    if found.st_mode & _GROUP and found.st_gid not in {0, os.getegid()}:
        return f"group {_group(found.st_gid)} may write {place}"
    return ""


def _name(number: int) -> str:
    try:
        return pwd.getpwuid(number).pw_name
    except KeyError:
        return str(number)


def _group(number: int) -> str:
    try:
        return grp.getgrgid(number).gr_name
    except KeyError:
        return str(number)
