/* Twin of runtime/control/safety/manoeuvre_rollout.py: rollouts of a manoeuvre, its path and its contacts. */

#include "arrays.h"
#include "constants.h"

enum { STEPS = MANOEUVRE_ROLLOUT_HORIZON_STEPS, MAX_ENDS = STEPS / MANOEUVRE_ROLLOUT_LOCK_STEPS + 3 };
#define STEP MANOEUVRE_ROLLOUT_STEP_S
#define TINY MANOEUVRE_ROLLOUT_TINY

/* The car, in the order of RolloutStart. */
struct car {
    double speed, brake, latency, rate, wheelbase, cornering, front, rear, half, waits;
};

/* The solid points, x and y apart, and room for as many distances. */
struct cloud {
    beam count;
    double *x, *y, *distance;
};

struct moves {
    double ahead, aside, yaw;
};

struct state {
    place middle;
    double heading, course, speed, wheel;
    struct moves moves;
};

struct end {
    double impact, room;
};

/* One floor, and the obstacles around. reach: of the outline's corners from the car's middle. */
struct ground {
    const struct car *car;
    struct cloud *points;
    double grip, margin, reach;
};

/* A car on its way. room: the least so far. clear: the points are at least so far from the outline, by the last look and
 * by how far any part of the outline can have moved since. What cannot lower the room is not looked at.
 */
struct rollout {
    struct state at;
    int step, hit;
    double room, clear;
};

static double length(double x, double y) { return sqrt(x * x + y * y); }

static struct moves turned(const struct car *car, struct moves m, double wheel, double brake, double grip) {
    double half = car->wheelbase / 2;
    if (m.ahead < MANOEUVRE_ROLLOUT_SLOW_MPS) {
        m.ahead = greater(0.0, m.ahead - brake * STEP);
        m.yaw = m.ahead * tan(wheel) / car->wheelbase;
        m.aside = half * m.yaw;
        return m;
    }
    double axle = sqrt(grip * grip - brake * brake) / 2;
    double front_slip = MANOEUVRE_ROLLOUT_FRONT_SHARE * car->cornering * (atan2(m.aside + half * m.yaw, m.ahead) - wheel);
    double rear_slip = car->cornering * atan2(m.aside - half * m.yaw, m.ahead);
    double front = -axle * front_slip / sqrt(1.0 + front_slip * front_slip);
    double rear = -axle * rear_slip / sqrt(1.0 + rear_slip * rear_slip), inward = front * cos(wheel);
    return (struct moves){
        m.ahead + (m.aside * m.yaw - brake - front * sin(wheel)) * STEP,
        m.aside + (inward + rear - m.ahead * m.yaw) * STEP,
        m.yaw + MANOEUVRE_ROLLOUT_YAW_RESPONSE * (inward - rear) / half * STEP,
    };
}

static struct moves slid(struct moves m, double drift, double grip) {
    double before = hypot(m.ahead, m.aside), speed = greater(0.0, before - grip * STEP);
    double kept = 1.0 - MANOEUVRE_ROLLOUT_SLIDE_DAMPING * grip * STEP / greater(before, MANOEUVRE_ROLLOUT_STANDING_MPS);
    return (struct moves){speed * cos(drift), speed * sin(drift), m.yaw * greater(0.0, kept)};
}

static struct state next(const struct ground *on, const struct state *at, double wheel, double slows) {
    struct state to = *at;
    to.wheel = wheel;
    if (slows >= on->grip) {
        to.moves = slid(at->moves, at->course - at->heading, on->grip);
        to.heading += to.moves.yaw * STEP;
    } else {
        to.moves = turned(on->car, at->moves, wheel, slows, on->grip);
        to.heading += to.moves.yaw * STEP;
        to.course = to.heading + atan2(to.moves.aside, greater(to.moves.ahead, MANOEUVRE_ROLLOUT_STANDING_MPS));
    }
    to.speed = length(to.moves.ahead, to.moves.aside);
    double moved = (at->speed + to.speed) / 2 * STEP;
    to.middle += CMPLX(moved * cos(to.course), moved * sin(to.course));
    return to;
}

/* The third-smallest; as `_third`. */
static double third(const double *values, beam count) {
    double low[3] = {INFINITY, INFINITY, INFINITY};
    for (beam i = 0; i < count; i++) {
        double value = values[i];
        if (value < low[2])
            for (int k = 0; k < 3; k++)
                if (value < low[k]) {
                    double other = low[k];
                    low[k] = value;
                    value = other;
                }
    }
    return low[2];
}

/* Pose of the outline's centre. */
static place centre_of(const struct car *car, place middle, double heading, place *turn) {
    *turn = CMPLX(cos(heading), sin(heading));
    return middle + (car->front - car->rear - car->wheelbase) / 2 * *turn;
}

static double distance(const struct car *car, place middle, double heading, struct cloud *points) {
    place turn, centre = centre_of(car, middle, heading, &turn);
    const double x0 = creal(centre), y0 = cimag(centre), c = creal(turn), s = cimag(turn);
    const double half = (car->front + car->rear) / 2, wide = car->half, *x = points->x, *y = points->y;
    double *restrict to = points->distance;
    for (beam i = 0; i < points->count; i++) {
        double dx = x[i] - x0, dy = y[i] - y0;
        double ahead = most(fabs(dx * c + dy * s) - half, 0.0), aside = most(fabs(dy * c - dx * s) - wide, 0.0);
        to[i] = ahead * ahead + aside * aside;
    }
    return sqrt(third(to, points->count));
}

static struct end slide(const struct ground *on, const struct rollout *from) {
    const struct car *car = on->car;
    const struct state *at = &from->at;
    struct cloud *points = on->points;
    const double grip = on->grip, margin = on->margin, speed = at->speed, way = speed * speed / (2 * grip);
    double turn_on = at->moves.yaw * speed / (2 * (MANOEUVRE_ROLLOUT_SLIDE_DAMPING + 1) * grip);
    /* The margin's own corners are farther out, by less than half of it. */
    if (from->clear - way - fabs(turn_on) * on->reach - 1.5 * margin >= from->room)
        return (struct end){0.0, from->room};
    double heading = at->heading + turn_on, drift = at->course - heading;
    place turn, centre = centre_of(car, at->middle, heading, &turn);
    const double x0 = creal(centre), y0 = cimag(centre), c = creal(turn), s = cimag(turn);
    const double along = (car->front + car->rear) / 2 + margin, cosine = cos(drift);
    const double sine = copysign(greater(fabs(sin(drift)), TINY), drift), wide = copysign(car->half + margin, sine);
    const double *x = points->x, *y = points->y;
    double *restrict to = points->distance;
    for (beam i = 0; i < points->count; i++) {
        double dx = x[i] - x0, dy = y[i] - y0, ahead = dx * c + dy * s, aside = dy * c - dx * s;
        double enters = most((ahead - along) / cosine, (aside - wide) / sine);
        double leaves = least((ahead + along) / cosine, (aside + wide) / sine);
        to[i] = enters <= leaves && leaves >= 0.0 ? enters : INFINITY;
    }
    double left = speed * speed - 2 * grip * greater(0.0, third(to, points->count));
    if (left > 0.0)
        return (struct end){sqrt(left), 0.0};
    place ahead = CMPLX(way * cos(at->course), way * sin(at->course));
    double room = lesser(distance(car, at->middle + ahead, heading, points),
                         distance(car, at->middle + ahead / 2, heading, points));
    return (struct end){0.0, lesser(greater(0.0, room - margin), from->room)};
}

static void look_around(const struct ground *on, struct rollout *car) {
    if (car->step % MANOEUVRE_ROLLOUT_LOOK_STEPS != 0 || !(car->at.speed > MANOEUVRE_ROLLOUT_STANDING_MPS) ||
        car->clear - on->margin >= car->room)
        return;
    car->clear = distance(on->car, car->at.middle, car->at.heading, on->points);
    car->room = lesser(car->room, car->clear - on->margin);
    car->hit = car->room <= 0.0;
}

static void drive_on(const struct ground *on, struct rollout *car, double wheel, double slows) {
    struct state to = next(on, &car->at, wheel, slows);
    place moved = to.middle - car->at.middle;
    car->clear -= length(creal(moved), cimag(moved)) + fabs(to.heading - car->at.heading) * on->reach;
    car->at = to;
    car->step++;
    look_around(on, car);
}

static int is_over(const struct rollout *car) { return car->hit || car->at.speed == 0.0; }

/* As `latency_path`. */
static struct rollout begun(const struct ground *on, const struct row *past, const struct row *coming) {
    const struct car *car = on->car;
    struct rollout begun = {.step = 0, .hit = 0, .room = MANOEUVRE_ROLLOUT_MAX_ROOM_M, .clear = -INFINITY};
    struct moves m = {car->speed, 0.0, 0.0};
    double wheel = 0.0;
    for (beam i = 0; i < past->count; i++) {
        wheel = NUMBER(*past, i);
        m.ahead = car->speed;
        m = turned(car, m, wheel, 0.0, on->grip);
    }
    begun.at = (struct state){car->wheelbase / 2, 0.0, atan2(m.aside, m.ahead), m.ahead, wheel, m};
    look_around(on, &begun);
    while (!is_over(&begun) && begun.step < STEPS && (begun.step + 1) * STEP <= car->latency) {
        if (begun.step < coming->count)
            wheel = NUMBER(*coming, begun.step);
        drive_on(on, &begun, wheel, car->brake);
    }
    return begun;
}

static int may_lock(const struct car *car, double brake, int step) {
    if (!isfinite(brake))
        return step * STEP >= car->latency || step == STEPS;
    return step == STEPS || (step % MANOEUVRE_ROLLOUT_LOCK_STEPS == 0 &&
                             step * STEP >= car->latency + MANOEUVRE_ROLLOUT_MIN_TURN_S + car->waits);
}

/* As `roll_out` and `_ends`; from: after the latency. */
static int ends_of(const struct ground *on, struct rollout from, double steering, double brake, struct end *ends) {
    const double most_rad = on->car->rate * STEP;
    for (int count = 0;;) {
        if (from.hit)
            ends[count++] = (struct end){from.at.speed, 0.0};
        else if (is_over(&from) || may_lock(on->car, brake, from.step))
            ends[count++] = slide(on, &from);
        if (is_over(&from) || from.step == STEPS || (count && !isfinite(brake)))
            return count;
        drive_on(on, &from, from.at.wheel + bounded(steering - from.at.wheel, -most_rad, most_rad), brake);
    }
}

/* floors: the last end of one holds for all later moments. */
static void best_end(struct end ends[][MAX_ENDS], const int *counts, beam floors, double *to) {
    double best_energy = INFINITY;
    int moments = 0;
    for (beam f = 0; f < floors; f++) {
        to[f] = INFINITY;
        moments = counts[f] > moments ? counts[f] : moments;
    }
    to[floors] = 0.0;
    for (int k = 0; k < moments; k++) {
        double energy = 0.0, room = INFINITY;
        struct end now[MANOEUVRE_ROLLOUT_MAX_FLOORS];
        for (beam f = 0; f < floors; f++) {
            now[f] = ends[f][k < counts[f] ? k : counts[f] - 1];
            energy += now[f].impact * now[f].impact;
            room = lesser(room, now[f].room);
        }
        if (!(energy < best_energy - TINY || (energy <= best_energy + TINY && room > to[floors] + TINY)))
            continue;
        best_energy = energy;
        to[floors] = room;
        for (beam f = 0; f < floors; f++)
            to[f] = now[f].impact;
    }
}

static int all_finite(const struct row *row) {
    for (beam i = 0; i < row->count; i++)
        if (!isfinite(NUMBER(*row, i)))
            return 0;
    return 1;
}

/* roll_out_all(points, steering, brake, grip, past, coming, *start) -> impacts and room of each manoeuvre */
KERNEL(roll_out_all) {
    struct row seen, steering, brake, grip, past, coming;
    struct car car;
    if (!enough(count, 16, "roll_out_all") || !as_row(given[0], NPY_CDOUBLE, &seen) ||
        !as_row(given[1], NPY_DOUBLE, &steering) || !as_row(given[2], NPY_DOUBLE, &brake) ||
        !as_row(given[3], NPY_DOUBLE, &grip) || !as_row(given[4], NPY_DOUBLE, &past) ||
        !as_row(given[5], NPY_DOUBLE, &coming) || !as_numbers(given + 6, 10, (double *)&car))
        return NULL;
    int fine = all_finite(&steering) && all_finite(&grip) && all_finite(&past) && all_finite(&coming) && car.brake >= 0 &&
               car.front + car.rear >= 0 && car.half >= 0 && car.waits >= 0;
    for (int i = 0; i < 10; i++)
        fine = fine && isfinite(((double *)&car)[i]);
    for (beam i = 0; i < brake.count; i++)
        fine = fine && NUMBER(brake, i) >= 0.0;
    for (beam i = 0; i < grip.count; i++)
        fine = fine && NUMBER(grip, i) > 0.0;
    if (!fine || steering.count != brake.count || grip.count < 1 || grip.count > MANOEUVRE_ROLLOUT_MAX_FLOORS) {
        PyErr_SetString(PyExc_ValueError,
                        "roll_outs: finite numbers, a steering for every brake, and 1 to 4 floors are needed");
        return NULL;
    }
    double *room = malloc(sizeof *room * 3 * (size_t)(seen.count + 1));
    if (!room)
        return PyErr_NoMemory();
    PyObject *answer = fresh(NPY_DOUBLE, steering.count * (grip.count + 1));
    struct cloud points = {seen.count, room, room + seen.count, room + 2 * seen.count};
    points.count = 0;
    for (beam i = 0; i < seen.count; i++)
        if (isfinite(creal(PLACE(seen, i))) && isfinite(cimag(PLACE(seen, i)))) {
            points.x[points.count] = creal(PLACE(seen, i));
            points.y[points.count++] = cimag(PLACE(seen, i));
        }
    double margin = 0.5 * distance(&car, car.wheelbase / 2, 0.0, &points) - TINY;
    margin = lesser(MANOEUVRE_ROLLOUT_MARGIN_M, margin);
    struct ground grounds[MANOEUVRE_ROLLOUT_MAX_FLOORS];
    struct rollout starts[MANOEUVRE_ROLLOUT_MAX_FLOORS];
    double half = car.wheelbase / 2, reach = length(most(fabs(car.front - half), fabs(car.rear + half)), car.half);
    for (beam f = 0; f < grip.count; f++) {
        grounds[f] = (struct ground){&car, &points, NUMBER(grip, f), margin, reach};
        starts[f] = begun(grounds + f, &past, &coming);
    }
    for (beam i = 0; answer && i < steering.count; i++) {
        struct end ends[MANOEUVRE_ROLLOUT_MAX_FLOORS][MAX_ENDS];
        int counts[MANOEUVRE_ROLLOUT_MAX_FLOORS];
        for (beam f = 0; f < grip.count; f++)
            counts[f] = ends_of(grounds + f, starts[f], NUMBER(steering, i), NUMBER(brake, i), ends[f]);
        best_end(ends, counts, grip.count, DATA(double, answer) + i * (grip.count + 1));
    }
    free(room);
    return answer;
}
