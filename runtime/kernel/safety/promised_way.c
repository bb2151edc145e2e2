/* Twin of runtime/control/safety/promised_way.py: a promised path as the way of a car, or why no car can drive it. */

#include "arrays.h"
#include "constants.h"

/* In the order of REFUSALS. */
enum refusal { GAPS, NOT_HERE, TOO_SHORT, CANNOT_STEER, NO_GRIP, DRIVABLE };

/* In the order of Roadworthy. */
struct car {
    double speed, wheel, latency, rate, wheelbase, most, grip, slip, gain;
};

/* Ways, places and speeds of a path from the car on; the middles of its chords and their directions. */
struct cut {
    beam count;
    double *along, *speed, *middle, *angle, *bend;
    place *at;
};

/* What `drive_promise` returns: arrays of `count`. */
struct way {
    beam count, within;
    double *travel, *curvature, *speed;
    place *at, *heading, *course;
    double promised;
};

/* Where a place lies among knots: in which piece, and by which share of it. */
struct spot {
    beam piece;
    double share;
};

/* As numpy's interp; from: a piece that is not beyond the place. One knot is a piece alone. */
static struct spot spot_of(const double *x, beam n, double at, beam from) {
    while (from + 2 < n && x[from + 1] <= at)
        from++;
    const double share = n > 1 ? (at - x[from]) / (x[from + 1] - x[from]) : 0.0;
    return (struct spot){from, within(share, 0.0, 1.0)};
}

#define BETWEEN(y, spot) ((y)[(spot).piece] + (spot).share * ((y)[(spot).piece + 1] - (y)[(spot).piece]))

/* `_from_here`; along, places and speeds of the promise: of n >= 2 points; `to` has room for n + 1. */
static enum refusal from_here(const double *along, const place *places, const double *speeds, beam n, struct cut *to) {
    double nearest = INFINITY, share_there = 0.0;
    beam first = 0;
    for (beam i = 0; i < n - 1 && (i == 0 || along[i + 1] < PROMISED_WAY_AHEAD_M); i++) {
        const place chord = places[i + 1] - places[i];
        const double gap = cabs(chord), beside = creal(times(places[i], conj(chord)));
        const double share = within(-beside / (gap * gap), 0.0, 1.0), off = cabs(places[i] + share * chord);
        if (off < nearest) {
            nearest = off;
            share_there = share;
            first = i;
        }
    }
    if (!(nearest <= PROMISED_WAY_HERE_M))
        return NOT_HERE;
    const double here = along[first] + share_there * cabs(places[first + 1] - places[first]), left = along[n - 1] - here;
    if (left < PROMISED_WAY_MIN_SPACING_M)
        return TOO_SHORT;
    const double chords = most(1.0, (double)(n - 1 - first) - share_there);
    const beam count = (beam)most(2.0, ceil(least(left / PROMISED_WAY_MIN_SPACING_M, chords) - PROMISED_WAY_ROUNDING) + 1.0);
    to->count = count;
    struct spot spot = {first, 0.0};
    for (beam i = 0; i < count; i++) {
        const double at = here + left * (double)i / (double)(count - 1);
        spot = spot_of(along, n, at, spot.piece);
        to->along[i] = at - here;
        to->at[i] = BETWEEN(places, spot);
        to->speed[i] = BETWEEN(speeds, spot);
    }
    return DRIVABLE;
}

/* The directions of the chords, and how they bend at the points between them. */
static enum refusal bends(struct cut *cut) {
    const beam chords = cut->count - 1;
    place before = 0.0;
    for (beam i = 0; i < chords; i++) {
        const place chord = cut->at[i + 1] - cut->at[i];
        cut->middle[i] = (cut->along[i + 1] + cut->along[i]) / 2;
        const double turned = carg(i ? times(chord, conj(before)) : chord);
        cut->angle[i] = i ? cut->angle[i - 1] + turned : turned;
        if (i)
            cut->bend[i - 1] = turned / (cut->middle[i] - cut->middle[i - 1]);
        before = chord;
    }
    if (chords == 2)
        cut->bend[1] = cut->bend[0];
    if (chords == 1) { /* a second knot for BETWEEN */
        cut->bend[0] = cut->bend[1] = 0.0;
        cut->angle[1] = cut->angle[0];
    }
    return fabs(cut->angle[0]) > PROMISED_WAY_HERE_RAD ? NOT_HERE : DRIVABLE;
}

/* `_believed_mps` at one place. */
static double believed(double promised, double travel, const struct car *car) {
    const double brakes = most(travel - car->speed * car->latency, 0.0), square = car->speed * car->speed;
    const double brake = lesser(PROMISED_WAY_MOTOR_BRAKE_MPS2, 0.8 * car->grip);
    const double left = most(square - 2.0 * brake * brakes, 0.0);
    const double gained = sqrt(square + 2.0 * car->gain * travel) + PROMISED_WAY_FASTER_MPS;
    return most(least(promised, gained), sqrt(left));
}

/* Poses every STEP_M; beyond the promise its last curvature goes on. */
static void resample(const struct cut *cut, const struct car *car, struct way *way) {
    const double step = FOOTPRINT_STEP_M;
    const beam n = cut->count, chords = n - 1, bent = chords > 1 ? chords - 1 : 1;
    const double *vertex = chords > 1 ? cut->along + 1 : cut->middle, last = cut->middle[chords - 1];
    const place ahead = CMPLX(cos(cut->angle[chords - 1]), sin(cut->angle[chords - 1]));
    struct spot at = {0, 0.0}, middle = at, corner = at;
    place moved = 0.0, begin = 0.0;
    way->within = 0;
    for (beam i = 0; i < way->count; i++) {
        const double travel = step * (double)(i + 1);
        at = spot_of(cut->along, n, travel, at.piece);
        middle = spot_of(cut->middle, chords, travel, middle.piece);
        corner = spot_of(vertex, bent, travel, corner.piece);
        const double bend = BETWEEN(cut->bend, corner);
        double course = BETWEEN(cut->angle, middle);
        if (travel >= last)
            course += bend * (travel - last);
        if (travel <= way->promised) {
            way->within = i + 1;
            way->at[i] = BETWEEN(cut->at, at);
        } else {
            if (way->within == i)
                begin = cut->at[n - 1] + ((double)i * step - way->promised) * ahead;
            const double halfway = course - bend * step / 2;
            moved += CMPLX(step * cos(halfway), step * sin(halfway));
            way->at[i] = begin + moved;
        }
        way->travel[i] = travel;
        way->curvature[i] = bend;
        way->course[i] = CMPLX(cos(course), sin(course));
        way->speed[i] = believed(BETWEEN(cut->speed, at), travel, car);
    }
}

/* `_driven`: the nose turned inward by the slip, where wheels and tyres can drive the promised part. */
static enum refusal drive(struct way *way, const struct car *car) {
    const double begins = PROMISED_WAY_CORRECTS_RAD - PROMISED_WAY_WHEEL_SPARE_RAD, spare = PROMISED_WAY_WHEEL_SPARE_RAD;
    double turned = 0.0, high = car->wheel + begins, low = car->wheel - begins, widest = fabs(car->wheel);
    int steered = 1;
    for (beam i = 0; i < way->within; i++) {
        const double speed = way->speed[i], wheel = atan(car->wheelbase * way->curvature[i]);
        if (fabs(speed * speed * way->curvature[i]) > PROMISED_WAY_GRIP_SPARE * car->grip)
            return NO_GRIP;
        turned += car->rate * FOOTPRINT_STEP_M / most(speed, FOOTPRINT_MIN_SLEW_SPEED_MPS);
        high = least(high, wheel - turned);
        low = most(low, wheel + turned);
        steered = steered && !(wheel > high + turned + spare || wheel < low - turned - spare);
        widest = most(widest, fabs(wheel));
    }
    if (!steered || widest > car->most + spare)
        return CANNOT_STEER;
    for (beam i = 0; i < way->count; i++) {
        const double speed = way->speed[i], aside = speed * speed * way->curvature[i];
        const double slip = within(aside, -car->grip, car->grip) * car->slip;
        way->heading[i] = times(way->course[i], CMPLX(cos(slip), sin(slip)));
    }
    return DRIVABLE;
}

/* The way from the cut on, as the arrays that Python gets. */
static PyObject *answer(const struct cut *cut, const struct car *car, double look) {
    struct way way = {.promised = cut->along[cut->count - 1]};
    const double steps = ceil(greater(look, way.promised) / FOOTPRINT_STEP_M);
    if (!isfinite(steps))
        return PyLong_FromDouble(steps); /* fails as ceil does */
    if (steps > 1e9)
        return PyErr_NoMemory();
    way.count = (beam)most(steps, 1.0);
    PyObject *rows[6] = {NULL};
    const int types[6] = {NPY_DOUBLE, NPY_CDOUBLE, NPY_CDOUBLE, NPY_DOUBLE, NPY_CDOUBLE, NPY_DOUBLE};
    PyObject *found = NULL;
    int made = 0;
    while (made < 6 && (rows[made] = fresh(types[made], way.count)) != NULL)
        made++;
    if (made == 6) {
        way.travel = DATA(double, rows[0]), way.at = DATA(place, rows[1]), way.heading = DATA(place, rows[2]);
        way.curvature = DATA(double, rows[3]), way.course = DATA(place, rows[4]), way.speed = DATA(double, rows[5]);
        resample(cut, car, &way);
        const enum refusal refused = drive(&way, car);
        found = refused == DRIVABLE ? Py_BuildValue("(OOOOOOd)", rows[0], rows[1], rows[2], rows[3], rows[4], rows[5],
                                                    way.promised)
                                    : PyLong_FromLong(refused);
    }
    while (made > 0)
        Py_DECREF(rows[--made]);
    return found;
}

/* drive_promise(places, speeds, look, *car) -> (travel, place, heading, curvature, course, speed, promised) | refusal */
KERNEL(drive_promise) {
    struct row places, speeds;
    double look;
    struct car car;
    if (!enough(count, 12, "drive_promise") || !as_row(given[0], NPY_CDOUBLE, &places) ||
        !as_row(given[1], NPY_DOUBLE, &speeds) || !as_numbers(given + 2, 1, &look) ||
        !as_numbers(given + 3, 9, (double *)&car))
        return NULL;
    const beam n = places.count, room = n + 1;
    if (n < 2 || speeds.count != n)
        return PyErr_Format(PyExc_ValueError, "drive_promise: fewer than two points, or arrays of different lengths");
    double *numbers = malloc(sizeof *numbers * (size_t)(2 * n + 5 * room));
    place *some = malloc(sizeof *some * (size_t)(n + room));
    if (!numbers || !some) {
        free(numbers), free(some);
        return PyErr_NoMemory();
    }
    double *along = numbers, *speed = numbers + n, *next = numbers + 2 * n;
    struct cut cut = {0, next, next + room, next + 2 * room, next + 3 * room, next + 4 * room, some + n};
    enum refusal refused = DRIVABLE;
    for (beam i = 0; i < n; i++) {
        some[i] = PLACE(places, i);
        speed[i] = NUMBER(speeds, i);
        const double gap = i ? cabs(some[i] - some[i - 1]) : 0.0;
        along[i] = i ? along[i - 1] + gap : 0.0;
        if (i && !(gap > 0.0 && gap <= PROMISED_WAY_MAX_GAP_M))
            refused = GAPS;
    }
    if (refused == DRIVABLE)
        refused = from_here(along, some, speed, n, &cut);
    if (refused == DRIVABLE)
        refused = bends(&cut);
    PyObject *found = refused == DRIVABLE ? answer(&cut, &car, look) : PyLong_FromLong(refused);
    free(numbers), free(some);
    return found;
}
