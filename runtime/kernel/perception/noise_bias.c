/* Twin of runtime/control/perception/noise_bias.py: the noise of the ranges. */

#include "arrays.h"
#include "constants.h"

/* learn_noise_m(noise, x, y, indices) -> noise; see noise_bias.py */
KERNEL(learn_noise_m) {
    struct row x, y, wall;
    double noise;
    if (!enough(count, 4, "learn_noise_m") || !as_numbers(given, 1, &noise) || !as_row(given[1], NPY_DOUBLE, &x) ||
        !as_row(given[2], NPY_DOUBLE, &y) || !as_row(given[3], NPY_INTP, &wall))
        return NULL;
    const beam part = NOISE_BIAS_NOISE_BEAMS;
    double least_square = INFINITY, before = 0.0;
    beam nearest = 0, above = 0;
    for (beam i = 0; i < wall.count; i++) {
        npy_intp at = INDEX(wall, i);
        if (at < 0 || at >= x.count || at >= y.count)
            return PyErr_Format(PyExc_IndexError, "learn_noise_m: no beam %zd", (Py_ssize_t)at);
        double square = NUMBER(x, at) * NUMBER(x, at) + NUMBER(y, at) * NUMBER(y, at);
        if (square < least_square || (isnan(square) && !isnan(least_square))) { /* as numpy's argmin */
            least_square = square;
            nearest = i;
        }
    }
    beam from = nearest > part ? nearest - part : 0, to = nearest + part < wall.count ? nearest + part : wall.count - 1;
    if (to - from < NOISE_BIAS_MIN_NOISE_BEAMS)
        return PyFloat_FromDouble(noise);
    for (beam i = from; i <= to; i++) {
        npy_intp at = INDEX(wall, i);
        double range = sqrt(NUMBER(x, at) * NUMBER(x, at) + NUMBER(y, at) * NUMBER(y, at));
        above += i > from && fabs(range - before) > noise;
        before = range;
    }
    noise *= 1.0 + NOISE_BIAS_NOISE_STEP * ((double)above / (double)(to - from) - 0.5);
    return PyFloat_FromDouble(bounded(noise, NOISE_BIAS_MIN_NOISE_M, NOISE_BIAS_MAX_NOISE_M));
}
