/* Twin of runtime/calibration/scan_motion.py: a scan laid over the surfaces of a key scan, by robust weights. */

#include "arrays.h"
#include "constants.h"
#include "steps.h"

/* x, y: of the points; of the key their surfaces, by its beams. */
struct laying {
    struct row x, y, key_x, key_y, normal_x, normal_y, usable;
    double first, step;
};

static struct told near_surfaces(const struct laying *s, const double *pose, double gate) {
    struct told told = {{0.0}, {0.0}, 0, 0};
    const place turn = CMPLX(cos(pose[2]), sin(pose[2]));
    for (beam i = 0; i < s->x.count; i++) {
        place turned = times(CMPLX(NUMBER(s->x, i), NUMBER(s->y, i)), turn), there = turned + CMPLX(pose[0], pose[1]);
        beam at = beam_toward(creal(there), cimag(there), s->first, s->step, s->usable.count);
        if (at < 0 || !FLAG(s->usable, at))
            continue;
        double dx = creal(there) - NUMBER(s->key_x, at), dy = cimag(there) - NUMBER(s->key_y, at);
        place normal = CMPLX(NUMBER(s->normal_x, at), NUMBER(s->normal_y, at));
        double off = creal(normal) * dx + cimag(normal) * dy;
        if (hypot(dx, dy) < SCAN_MOTION_SAME_PLACE_M && fabs(off) < gate)
            tell(&told, normal, turned, off, 1.0 / most(1.0, fabs(off) / SCAN_MOTION_HUBER_M));
    }
    return told;
}

static PyObject *laid(const double *shift, const double *information) {
    npy_intp size[2] = {3, 3};
    PyObject *square = PyArray_SimpleNew(2, size, NPY_DOUBLE);
    if (square == NULL)
        return NULL;
    memcpy(DATA(double, square), information, 9 * sizeof(double));
    return Py_BuildValue("(NN)", copied(NPY_DOUBLE, 3, shift), square);
}

/* lay_over(x, y, key x, key y, normal x, normal y, usable, first angle, angle step, guess x, y, yaw, its weight)
 *     -> shift, information */
KERNEL(lay_over) {
    struct laying s;
    struct row *rows[6] = {&s.x, &s.y, &s.key_x, &s.key_y, &s.normal_x, &s.normal_y};
    double n[6], shift[3];
    if (!enough(count, 13, "lay_over") || !as_row(given[6], NPY_BOOL, &s.usable) || !as_numbers(given + 7, 6, n))
        return NULL;
    for (int i = 0; i < 6; i++)
        if (!as_row(given[i], NPY_DOUBLE, rows[i]))
            return NULL;
        else if (rows[i]->count != (i < 2 ? s.x : s.usable).count)
            return PyErr_Format(PyExc_ValueError, "lay_over: arrays of different lengths");
    s.first = n[0], s.step = n[1];
    const double *guess = n + 2, weight = n[5];
    const double gates[4] = {SCAN_MOTION_GATES_M_0, SCAN_MOTION_GATES_M_1, SCAN_MOTION_GATES_M_2, SCAN_MOTION_GATES_M_3};
    struct told told = {{0.0}, {0.0}, 0, 0};
    memcpy(shift, guess, sizeof shift);
    for (int round = 0; round < SCAN_MOTION_ROUNDS; round++) {
        double sum[9], pull[3], move[3], furthest = 0.0;
        told = near_surfaces(&s, shift, gates[round < 3 ? round : 3]);
        for (int i = 0; i < 9; i++)
            sum[i] = told.information[i] + (i % 4 == 0 ? weight : 0.0);
        for (int i = 0; i < 3; i++)
            pull[i] = told.pull[i] + weight * (shift[i] - guess[i]);
        if (!solve_three(sum, pull, move))
            return NULL;
        for (int i = 0; i < 3; i++) {
            shift[i] += move[i];
            furthest = greater(fabs(move[i]), furthest);
        }
        if (furthest < SCAN_MOTION_ENOUGH_M)
            break;
    }
    return laid(shift, told.information);
}
