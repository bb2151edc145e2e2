/* Twin of runtime/control/safety/promise_judgement.py: what hides a promised path. */

#include "arrays.h"
#include "constants.h"

/* first_hidden(nose, ranges, first, step) -> number of a place, or -1 */
KERNEL(first_hidden) {
    struct row nose, ranges;
    double fan[2];
    if (!enough(count, 4, "first_hidden") || !as_row(given[0], NPY_CDOUBLE, &nose) ||
        !as_row(given[1], NPY_DOUBLE, &ranges) || !as_numbers(given + 2, 2, fan))
        return NULL;
    const double wide = nearbyint(PROMISE_JUDGEMENT_SIGHT_RAD / fabs(fan[1]));
    if (!ranges.count || !(wide < 1e6))
        return PyErr_Format(PyExc_ValueError, "first_hidden: no beams, or no angle between them");
    const beam width = wide > 1.0 ? (beam)wide : 1;
    for (beam i = 0; i < nose.count; i++) {
        const place at = PLACE(nose, i);
        const double away = cabs(at) - PROMISE_JUDGEMENT_SIGHT_SPARE_M;
        const double middle = rint((carg(at) - fan[0]) / fan[1]);
        beam nearer = 0;
        for (beam k = -width; k <= width; k++) {
            const double number = middle + (double)k;
            if (!(number >= 0.0 && number < (double)ranges.count) || NUMBER(ranges, (beam)number) < away)
                nearer++;
        }
        if (nearer > width)
            return PyLong_FromSsize_t(i);
    }
    return PyLong_FromLong(-1);
}
