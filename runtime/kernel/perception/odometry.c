/* Twin of runtime/control/perception/odometry.py: one step of dead reckoning. */

#include "arrays.h"
#include "constants.h"

/* dead_reckon(x, y, yaw, step, steering, wheelbase) -> x, y, yaw, curvature */
KERNEL(dead_reckon) {
    double v[6];
    if (!enough(count, 6, "dead_reckon") || !as_numbers(given, 6, v))
        return NULL;
    double curvature = tan(v[4]) / v[5], turn = v[3] * curvature, middle = v[2] + turn / 2;
    if (isinf(v[4]) || isinf(middle)) {
        PyErr_SetString(PyExc_ValueError, "math domain error"); /* as Python's tan and cos */
        return NULL;
    }
    return Py_BuildValue("(dddd)", v[0] + v[3] * cos(middle), v[1] + v[3] * sin(middle),
                         remainder(v[2] + turn, 2 * Py_MATH_PI), curvature);
}
