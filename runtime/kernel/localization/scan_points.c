/* Twin of runtime/control/localization/scan_points.py: ends of beams, as seen at the time of the last one. */

#include "arrays.h"
#include "constants.h"

static float range_of(const struct row *ranges, beam i) {
    float range = AT(float, *ranges, i), far = (float)SCAN_POINTS_FAR_M;
    return range > (float)SCAN_POINTS_MIN_RANGE_M && range < far ? range : far;
}

/* Which beams end on something narrow with only farther things on both sides; from the last beam to the first, so that
 * where it ends is known. */
static void stand_alone(const struct row *ranges, double step, npy_bool *alone) {
    beam end = 0, marked = 0;
    for (beam i = ranges->count - 1; i > 0; i--) {
        float range = range_of(ranges, i), change = range - range_of(ranges, i - 1);
        if (change > (float)SCAN_POINTS_JUMP_M)
            end = marked = i;
        else if (end && change < -(float)SCAN_POINTS_JUMP_M && (double)(end - i) * step * range < SCAN_POINTS_ALONE_M) {
            memset(alone + i, 1, (size_t)(marked - i));
            marked = i;
        }
    }
}

/* ends_of_beams(ranges, ahead, age, farthest, step, lidar x, lidar y, speed ahead, speed to the left, turn)
 *   -> places, ahead, alone */
KERNEL(ends_of_beams) {
    struct row ranges, ahead, age;
    double v[7];
    if (!enough(count, 10, "ends_of_beams") || !as_row(given[0], NPY_FLOAT, &ranges) ||
        !as_row(given[1], NPY_CDOUBLE, &ahead) || !as_row(given[2], NPY_DOUBLE, &age) || !as_numbers(given + 3, 7, v))
        return NULL;
    const beam beams = ranges.count;
    if (ahead.count != beams || age.count != beams)
        return PyErr_Format(PyExc_ValueError, "ends_of_beams: arrays of different lengths");
    npy_bool *alone = calloc((size_t)beams + 1, 1);
    place *ends = malloc(sizeof *ends * (size_t)(2 * beams + 1)), *toward = ends + beams;
    if (!alone || !ends) {
        free(alone);
        free(ends);
        return PyErr_NoMemory();
    }
    stand_alone(&ranges, v[1], alone);
    const int moves = v[4] != 0.0 || v[6] != 0.0;
    beam known = 0;
    for (beam i = 0; i < beams; i++) {
        float range = AT(float, ranges, i);
        if (!(range > (float)SCAN_POINTS_MIN_RANGE_M && range < (float)v[0]))
            continue;
        place unit = PLACE(ahead, i), end = CMPLX(creal(unit) * range + v[2], cimag(unit) * range + v[3]);
        if (moves) {
            double back = NUMBER(age, i);
            place turned = CMPLX(cos(v[6] * back), -sin(v[6] * back));
            end = times(turned, end) + CMPLX(-v[4] * back, (0.5 * v[4] * v[6] * back - v[5]) * back);
            unit = times(turned, unit);
        }
        ends[known] = end;
        toward[known] = unit;
        alone[known++] = alone[i];
    }
    PyObject *answer = Py_BuildValue("(NNN)", copied(NPY_CDOUBLE, known, ends), copied(NPY_CDOUBLE, known, toward),
                                     copied(NPY_BOOL, known, alone));
    free(alone);
    free(ends);
    return answer;
}
