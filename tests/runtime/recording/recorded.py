"""The files of a recorded drive, for the tests of the recorder."""

from wallride.runtime.recording.ring import parse


def files(folder, pattern="*.mcap"):
    return sorted(folder.glob(pattern), key=number_of)


def number_of(path):
    found = parse(path.name)
    assert found is not None
    return found[0]


def recordings(folder):
    return [path for path in files(folder) if "-stop" not in path.name]
