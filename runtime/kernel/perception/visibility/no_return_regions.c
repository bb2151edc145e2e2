/* Twin of runtime/control/perception/visibility/no_return_regions.py: regions without echo. */

#include "arrays.h"
#include "constants.h"

/* find_dark_regions(no_echo, solid, ranges, angle_min, angle_step, toward, near_m) -> bool */
KERNEL(find_dark_regions) {
    struct row no_echo, solid, range;
    double v[4];
    if (!enough(count, 7, "find_dark_regions") || !as_row(given[0], NPY_BOOL, &no_echo) ||
        !as_row(given[1], NPY_BOOL, &solid) || !as_row(given[2], NPY_DOUBLE, &range) || !as_numbers(given + 3, 4, v))
        return NULL;
    if (solid.count != no_echo.count || range.count != no_echo.count) {
        PyErr_SetString(PyExc_ValueError, "dark_around: arrays of different lengths");
        return NULL;
    }
    if (!v[1]) {
        PyErr_SetString(PyExc_ZeroDivisionError, "float division by zero");
        return NULL;
    }
    /* of two equally near beams the even one, as Python's round */
    double middle = rint((v[2] - v[0]) / v[1]), width = rint(NO_RETURN_REGIONS_DARK_WINDOW_RAD / fabs(v[1])), near_m = v[3];
    if (!isfinite(middle) || !isfinite(width))
        return PyLong_FromDouble(isfinite(middle) ? width : middle); /* fails as round does */
    const beam first = (beam)within(middle - width, 0.0, (double)no_echo.count);
    const beam last = (beam)within(middle + width + 1, 0.0, (double)no_echo.count);
    beam dark = 0, from = -1, to = -1;
    for (beam i = first; i < last; i++)
        if (FLAG(no_echo, i)) {
            dark++;
            if (from < 0)
                from = i;
            to = i;
        }
    if (last <= first || (double)dark <= NO_RETURN_REGIONS_DARK_SHARE * (double)(last - first))
        Py_RETURN_FALSE;
    beam right = from - 1, left = to + 1;
    while (right >= 0 && !FLAG(solid, right))
        right--;
    while (left < solid.count && !FLAG(solid, left))
        left++;
    if (right < 0 || left >= solid.count)
        Py_RETURN_FALSE;
    return PyBool_FromLong(greater(NUMBER(range, right), NUMBER(range, left)) < near_m);
}
