/* Twin of runtime/ros/laser_scan.py: the ranges of a message of ROS. */

#include "arrays.h"
#include "constants.h"

/* usable_ranges(payload, begin, beams, near_m, far_m, reverse) -> ranges */
KERNEL(usable_ranges) {
    char *payload;
    Py_ssize_t bytes;
    beam number[2], reverse;
    double limit_m[2];
    if (!enough(count, 6, "usable_ranges") || PyBytes_AsStringAndSize(given[0], &payload, &bytes) < 0 ||
        !as_indices(given + 1, 2, number) || !as_numbers(given + 3, 2, limit_m) || !as_indices(given + 5, 1, &reverse))
        return NULL;
    beam begin = number[0], beams = number[1];
    if (begin < 0 || beams < 0 || begin > bytes || beams > (bytes - begin) / 4)
        return PyErr_Format(PyExc_ValueError, "usable_ranges: no %zd ranges from byte %zd on", beams, begin);
    PyObject *ranges = fresh(NPY_FLOAT, beams);
    if (!ranges)
        return NULL;
    float low_m = (float)limit_m[0], high_m = (float)limit_m[1];
    for (beam i = 0; i < beams; i++) {
        float range_m;
        memcpy(&range_m, payload + begin + 4 * i, sizeof range_m); /* may lie anywhere */
        int usable = range_m >= low_m && range_m <= high_m && range_m > 0.0f;
        DATA(float, ranges)[reverse ? beams - 1 - i : i] = usable ? range_m : NAN;
    }
    PyArray_CLEARFLAGS((PyArrayObject *)ranges, NPY_ARRAY_WRITEABLE);
    return ranges;
}
