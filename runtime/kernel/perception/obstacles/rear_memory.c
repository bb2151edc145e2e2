/* Twins of runtime/control/perception/obstacles/rear_memory.py: near obstacles, kept in odom, and those behind. */

#include "arrays.h"
#include "constants.h"

/* find_near_places(x, y, solid, ranges, at x, at y, yaw) -> places in odom */
KERNEL(find_near_places) {
    struct row x, y, solid, range;
    double v[3];
    if (!enough(count, 7, "find_near_places") || !as_row(given[0], NPY_DOUBLE, &x) || !as_row(given[1], NPY_DOUBLE, &y) ||
        !as_row(given[2], NPY_BOOL, &solid) || !as_row(given[3], NPY_DOUBLE, &range) || !as_numbers(given + 4, 3, v))
        return NULL;
    if (x.count != range.count || y.count != range.count || solid.count != range.count)
        return PyErr_Format(PyExc_ValueError, "near_places: arrays of different lengths");
    if (isinf(v[2]))
        return PyErr_Format(PyExc_ValueError, "math domain error");
    beam few = 0;
    for (beam i = 0; i < range.count; i++)
        few += FLAG(solid, i) && NUMBER(range, i) < REAR_MEMORY_NEAR_M;
    PyObject *answer = fresh(NPY_CDOUBLE, few);
    if (!answer)
        return NULL;
    place turned = CMPLX(cos(v[2]), sin(v[2])), at = CMPLX(v[0], v[1]), *to = DATA(place, answer);
    for (beam i = 0; i < range.count; i++)
        if (FLAG(solid, i) && NUMBER(range, i) < REAR_MEMORY_NEAR_M)
            *to++ = times(CMPLX(NUMBER(x, i), NUMBER(y, i)), turned) + at;
    return answer;
}

/* places_behind(places, at x, at y, yaw, lidar x, lidar y, half view) -> places in base_link */
KERNEL(places_behind) {
    struct row from;
    double v[6];
    if (!enough(count, 7, "places_behind") || !as_row(given[0], NPY_CDOUBLE, &from) || !as_numbers(given + 1, 6, v))
        return NULL;
    if (isinf(v[2]))
        return PyErr_Format(PyExc_ValueError, "math domain error");
    place turned = CMPLX(cos(-v[2]), sin(-v[2])), at = CMPLX(v[0], v[1]), *found = NULL;
    const double lidar_x = v[3], lidar_y = v[4], half_view = v[5] + REAR_MEMORY_ROUNDING_RAD;
    const double cosine = half_view < M_PI ? cos(half_view) : -INFINITY;
    beam few = 0, most_places = 0;
    for (beam i = 0; i < from.count; i++) {
        place here = times(PLACE(from, i) - at, turned);
        double x = creal(here), y = cimag(here), ahead = x - lidar_x, aside = y - lidar_y;
        if (!(x * x + y * y < REAR_MEMORY_NEAR_M * REAR_MEMORY_NEAR_M) ||
            !((half_view < 0.0 && ahead == ahead && aside == aside) || ahead < cosine * sqrt(ahead * ahead + aside * aside)))
            continue;
        if (few == most_places) { /* one large buffer for all would cost more than the loop */
            most_places = 2 * most_places + 512;
            place *larger = realloc(found, sizeof *found * (size_t)most_places);
            if (!larger) {
                free(found);
                return PyErr_NoMemory();
            }
            found = larger;
        }
        found[few++] = here;
    }
    PyObject *answer = copied(NPY_CDOUBLE, few, found);
    free(found);
    return answer;
}
