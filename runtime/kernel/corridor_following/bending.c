/* Twin of runtime/control/corridor_following/bending.py: the room beside a way. */

#include "arrays.h"
#include "constants.h"

/* free_beside_m(way, course, border, side) -> distances */
KERNEL(free_beside_m) {
    struct row way, course, border;
    double side;
    if (!enough(count, 4, "free_beside_m") || !as_row(given[0], NPY_CDOUBLE, &way) ||
        !as_row(given[1], NPY_CDOUBLE, &course) || !as_row(given[2], NPY_CDOUBLE, &border) ||
        !as_numbers(given + 3, 1, &side))
        return NULL;
    if (course.count != way.count)
        return PyErr_Format(PyExc_ValueError, "free_beside_m: arrays of different lengths");
    PyObject *answer = fresh(NPY_DOUBLE, way.count);
    for (beam i = 0; answer && i < way.count; i++) {
        place at = PLACE(way, i), back = conj(PLACE(course, i));
        double free_m = BENDING_FREE_M;
        for (beam k = 0; k < border.count; k++) {
            place seen = times(PLACE(border, k) - at, back);
            double aside = side * cimag(seen), chord2 = BENDING_KEEP_M * BENDING_KEEP_M - creal(seen) * creal(seen);
            if (chord2 > 0.0 && aside > -BENDING_BEYOND_M)
                free_m = least(aside - sqrt(chord2), free_m);
        }
        DATA(double, answer)[i] = free_m;
    }
    return answer;
}
