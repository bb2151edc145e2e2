/* Twin of drivers/hokuyo/ranges.py: the characters of a scan as metres. */

#include "arrays.h"
#include "constants.h"

/* decode_samples(samples, beams, range_min_mm, range_max_mm, reverse) -> ranges | None */
KERNEL(decode_samples) {
    char *samples;
    Py_ssize_t bytes;
    beam number[4];
    if (!enough(count, 5, "decode_samples") || PyBytes_AsStringAndSize(given[0], &samples, &bytes) < 0 ||
        !as_indices(given + 1, 4, number))
        return NULL;
    beam beams = number[0], low = number[1], high = number[2], reverse = number[3];
    if (bytes != 3 * beams)
        Py_RETURN_NONE;
    PyObject *ranges = fresh(NPY_FLOAT, beams);
    if (!ranges)
        return NULL;
    unsigned char wrong = 0;
    for (beam i = 0; i < beams; i++) {
        const unsigned char *at = (const unsigned char *)samples + 3 * i;
        unsigned char a = at[0] - 0x30, b = at[1] - 0x30, c = at[2] - 0x30;
        wrong |= a | b | c;
        int mm = (a << 12) + (b << 6) + c;
        DATA(float, ranges)[reverse ? beams - 1 - i : i] = mm < low || mm > high ? NAN : (float)mm / 1000.0f;
    }
    if (wrong > 63) {
        Py_DECREF(ranges);
        Py_RETURN_NONE;
    }
    PyArray_CLEARFLAGS((PyArrayObject *)ranges, NPY_ARRAY_WRITEABLE);
    return ranges;
}
