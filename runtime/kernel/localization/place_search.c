/* Twin of runtime/control/localization/place_search.py: how near a scan's beams end to walls, from many places. */

#include "arrays.h"
#include "constants.h"

/* mean_nearness(nearness, cells, ends) -> means */
KERNEL(mean_nearness) {
    struct row near, cells, ends;
    if (!enough(count, 3, "mean_nearness") || !as_row(given[0], NPY_FLOAT, &near) || !as_row(given[1], NPY_INTP, &cells) ||
        !as_row(given[2], NPY_INTP, &ends))
        return NULL;
    if (!near.count)
        return PyErr_Format(PyExc_IndexError, "mean_nearness: a map without cells"); /* as numpy's take */
    PyObject *answer = fresh(NPY_DOUBLE, cells.count);
    if (!answer)
        return NULL;
    double *mean = DATA(double, answer);
    memset(mean, 0, sizeof *mean * (size_t)cells.count);
    /* beam by beam: neighbouring places read neighbouring cells */
    for (beam k = 0; k < ends.count; k++)
        for (beam i = 0; i < cells.count; i++) {
            npy_uintp end = (npy_uintp)INDEX(cells, i) + (npy_uintp)INDEX(ends, k); /* wraps, as numpy's sum */
            npy_intp at = (npy_intp)end;
            mean[i] += (double)AT(float, near, at < 0 ? 0 : at >= near.count ? near.count - 1 : at);
        }
    for (beam i = 0; i < cells.count; i++)
        mean[i] /= (double)(ends.count ? ends.count : 1);
    return answer;
}
