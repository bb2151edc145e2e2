/* Twin of drivers/hokuyo/codec.py: the characters of a scan, verified and joined. */

#include "arrays.h"
#include "constants.h"

#define ROW_BYTES ((Py_ssize_t)CODEC_ROW_BYTES)

/* join_rows(data) -> samples | None: lines of 64 characters, a checksum, a line feed; the last one may be shorter and
 * has no line feed. None where that is not so, for whatever reason. */
static PyObject *joined(const char *data, Py_ssize_t bytes) {
    char *to;
    Py_ssize_t rows = bytes / ROW_BYTES, tail = bytes % ROW_BYTES;
    if (tail < 2)
        Py_RETURN_NONE;
    PyObject *samples = PyBytes_FromStringAndSize(NULL, rows * CODEC_LINE_CHARS + tail - 1);
    if (!samples)
        return NULL;
    to = PyBytes_AS_STRING(samples);
    int wrong = 0;
    for (Py_ssize_t row = 0; row <= rows; row++, data += ROW_BYTES) {
        Py_ssize_t wide = row < rows ? CODEC_LINE_CHARS : tail - 1;
        unsigned char sum = 0, feeds = 0;
        for (Py_ssize_t i = 0; i < wide; i++) {
            sum = (unsigned char)(sum + (unsigned char)data[i]);
            feeds |= data[i] == '\n';
        }
        wrong |= feeds | ((sum & 0x3f) + 0x30 != (unsigned char)data[wide]);
        wrong |= row < rows && data[wide + 1] != '\n';
        memcpy(to, data, (size_t)wide);
        to += wide;
    }
    if (wrong) {
        Py_DECREF(samples);
        Py_RETURN_NONE;
    }
    return samples;
}

KERNEL(join_rows) {
    char *data;
    Py_ssize_t bytes;
    if (!enough(count, 1, "join_rows") || PyBytes_AsStringAndSize(given[0], &data, &bytes) < 0)
        return NULL;
    return joined(data, bytes);
}

/* Whether a line of this many characters, the last one its checksum, has the right checksum. */
static int sums_up(const char *line, Py_ssize_t chars) {
    unsigned char sum = 0;
    for (Py_ssize_t i = 0; i < chars - 1; i++)
        sum = (unsigned char)(sum + (unsigned char)line[i]);
    return (sum & 0x3f) + 0x30 == (unsigned char)line[chars - 1];
}

static int is_ascii(const char *line, Py_ssize_t chars) {
    unsigned char all = 0;
    for (Py_ssize_t i = 0; i < chars; i++)
        all |= (unsigned char)line[i];
    return all < 128;
}

/* split_scan(raw) -> (echo, status, stamp, samples) | None */
KERNEL(split_scan) {
    char *at, *end;
    Py_ssize_t bytes, chars[3];
    const char *line[3];
    if (!enough(count, 1, "split_scan") || PyBytes_AsStringAndSize(given[0], &at, &bytes) < 0)
        return NULL;
    end = at + bytes;
    for (int i = 0; i < 3; i++) {
        char *feed = at < end ? memchr(at, '\n', (size_t)(end - at)) : NULL;
        if (!feed)
            Py_RETURN_NONE; /* a scan has a line more */
        line[i] = at;
        chars[i] = feed - at;
        at = feed + 1;
    }
    if (chars[0] < 1 || chars[0] > CODEC_ECHO_LIMIT_CHARS || chars[1] != 3 || chars[2] < 2 ||
        !is_ascii(line[0], chars[0]) || !is_ascii(line[1], 3) || !sums_up(line[1], 3) || !sums_up(line[2], chars[2]))
        Py_RETURN_NONE;
    PyObject *samples = joined(at, end - at);
    if (!samples || samples == Py_None)
        return samples;
    return Py_BuildValue("(y#y#y#N)", line[0], chars[0], line[1], (Py_ssize_t)2, line[2], chars[2] - 1, samples);
}
