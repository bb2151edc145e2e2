"""Who else may change a file: what decides whether this process may run its code, or believe its rights and keys."""

import getpass
import grp
import os
import pwd
import stat
from pathlib import Path


def is_root() -> bool:
    """Tell whether this process may do everything, so that what it runs must be root's alone."""
    return os.geteuid() == 0


def user_name(otherwise: str) -> str:
    """Return the name of this process's user, `otherwise` for one without a name, as in some containers."""
    try:
        return getpass.getuser()
    except (KeyError, OSError):
        return otherwise


def changed_by_others(path: Path) -> str:
    """Return who besides root and this user may change what is at a path, as a clause; "" where there is none.

    The folders above count as well, but for a sticky one, in which nothing of another user can be exchanged, and the
    links on the way.
    """
    named, place = path.absolute(), path.resolve()
    links = [_owner(one) for one in (named, *named.parents) if one.is_symlink()]
    places = [_owner(one) or _writers(one, above=one != place) for one in (place, *place.parents)]
    return next(filter(None, links + places), "")


def _owner(place: Path) -> str:
    owner = place.lstat().st_uid
    return "" if owner in {0, os.geteuid()} else f"{place} belongs to user {_name(owner)}"


def _writers(place: Path, *, above: bool) -> str:
    found = place.lstat()
    if above and found.st_mode & stat.S_ISVTX:
        return ""
    if found.st_mode & stat.S_IWOTH:
        return f"every user may write {place}"
    if found.st_mode & stat.S_IWGRP and found.st_gid not in {0, os.getegid()}:
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
