/* Twin of runtime/control/safety/manoeuvre_rollout.py: where a manoeuvre takes the car, and what it hits. */

#include "arrays.h"
#include "constants.h"

enum { STEPS = MANOEUVRE_ROLLOUT_HORIZON_STEPS, MOST_ENDS = STEPS / MANOEUVRE_ROLLOUT_LOCK_STEPS + 2 };
static const double STEP = MANOEUVRE_ROLLOUT_STEP_S, TINY = MANOEUVRE_ROLLOUT_TINY;

/* The car, in the order of Start. */
struct car {
    double speed, brake, latency, rate, wheelbase, cornering, front, rear, half;
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
    double heading, course, speed, yaw;
};

struct end {
    double impact, room;
};

static struct moves turned(const struct car *car, struct moves m, double wheel, double brake, double grip) {
    double half = car->wheelbase / 2;
    if (m.ahead < MANOEUVRE_ROLLOUT_SLOW_MPS) {
        m.ahead = greater(0.0, m.ahead - brake * STEP);
        m.yaw = m.ahead * tan(wheel) / car->wheelbase;
        m.aside = half * m.yaw;
        return m;
    }
    double axle = sqrt(grip * grip - brake * brake) / 2;
    double front_slip = car->cornering * (atan2(m.aside + half * m.yaw, m.ahead) - wheel);
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

static void roll_out(const struct car *car, const struct row *past, const struct row *coming, double steering,
                     double brake, double grip, struct state *path) {
    struct moves m = {car->speed, 0.0, 0.0};
    double wheel = 0.0, heading = 0.0;
    place middle = car->wheelbase / 2;
    for (beam i = 0; i < past->count; i++) {
        wheel = NUMBER(*past, i);
        m.ahead = car->speed;
        m = turned(car, m, wheel, 0.0, grip);
    }
    double course = atan2(m.aside, m.ahead);
    path[0] = (struct state){middle, heading, course, m.ahead, m.yaw};
    for (int step = 1; step <= STEPS; step++) {
        int acts = step * STEP > car->latency;
        double slows = acts ? brake : car->brake, most_rad = car->rate * STEP;
        if (acts)
            wheel += bounded(steering - wheel, -most_rad, most_rad);
        else if (step <= coming->count)
            wheel = NUMBER(*coming, step - 1);
        if (slows >= grip) {
            m = slid(m, course - heading, grip);
            heading += m.yaw * STEP;
        } else {
            m = turned(car, m, wheel, slows, grip);
            heading += m.yaw * STEP;
            course = heading + atan2(m.aside, greater(m.ahead, MANOEUVRE_ROLLOUT_STANDING_MPS));
        }
        double speed = hypot(m.ahead, m.aside), moved = (path[step - 1].speed + speed) / 2 * STEP;
        middle += CMPLX(moved * cos(course), moved * sin(course));
        path[step] = (struct state){middle, heading, course, speed, m.yaw};
    }
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

/* Where the outline's centre is, and how it is turned. */
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

static struct end slide(const struct car *car, const struct state *at, struct cloud *points, double grip, double margin) {
    double speed = at->speed, heading = at->heading + at->yaw * speed / (2 * (MANOEUVRE_ROLLOUT_SLIDE_DAMPING + 1) * grip);
    double drift = at->course - heading;
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
    double way = speed * speed / (2 * grip);
    place ahead = CMPLX(way * cos(at->course), way * sin(at->course));
    double room = lesser(distance(car, at->middle + ahead, heading, points),
                         distance(car, at->middle + ahead / 2, heading, points));
    return (struct end){0.0, lesser(greater(0.0, room - margin), MANOEUVRE_ROLLOUT_MAX_ROOM_M)};
}

static int may_lock(const struct car *car, double brake, int step) {
    if (!isfinite(brake))
        return step * STEP >= car->latency || step == STEPS;
    return step == STEPS || (step % MANOEUVRE_ROLLOUT_LOCK_STEPS == 0 &&
                             step * STEP >= car->latency + MANOEUVRE_ROLLOUT_MIN_TURN_S);
}

static int ends_of(const struct car *car, const struct state *path, struct cloud *points, double brake, double grip,
                   double margin, struct end *ends) {
    int count = 0;
    double room = MANOEUVRE_ROLLOUT_MAX_ROOM_M, hit = -1.0;
    for (int step = 0; step <= STEPS; step++) {
        const struct state *at = path + step;
        if (step % MANOEUVRE_ROLLOUT_LOOK_STEPS == 0 && hit < 0.0 && at->speed > MANOEUVRE_ROLLOUT_STANDING_MPS) {
            room = lesser(room, distance(car, at->middle, at->heading, points) - margin);
            if (room <= 0.0)
                hit = at->speed;
        }
        if (!may_lock(car, brake, step))
            continue;
        struct end end = {hit, 0.0};
        if (hit < 0.0) {
            end = slide(car, at, points, grip, margin);
            end.room = lesser(end.room, room);
        }
        ends[count++] = end;
        if (!isfinite(brake))
            break;
    }
    return count;
}

static void best_end(struct end ends[][MOST_ENDS], beam floors, int count, double *to) {
    double best_energy = INFINITY;
    for (beam f = 0; f < floors; f++)
        to[f] = INFINITY;
    to[floors] = 0.0;
    for (int k = 0; k < count; k++) {
        double energy = 0.0, room = INFINITY;
        for (beam f = 0; f < floors; f++) {
            energy += ends[f][k].impact * ends[f][k].impact;
            room = lesser(room, ends[f][k].room);
        }
        if (!(energy < best_energy - TINY || (energy <= best_energy + TINY && room > to[floors] + TINY)))
            continue;
        best_energy = energy;
        to[floors] = room;
        for (beam f = 0; f < floors; f++)
            to[f] = ends[f][k].impact;
    }
}

static int all_finite(const struct row *row) {
    for (beam i = 0; i < row->count; i++)
        if (!isfinite(NUMBER(*row, i)))
            return 0;
    return 1;
}

/* roll_outs(points, steering, brake, grip, past, coming, *start) -> impacts and room of each manoeuvre */
KERNEL(roll_outs) {
    struct row seen, steering, brake, grip, past, coming;
    struct car car;
    if (!enough(count, 15, "roll_outs") || !as_row(given[0], NPY_CDOUBLE, &seen) ||
        !as_row(given[1], NPY_DOUBLE, &steering) || !as_row(given[2], NPY_DOUBLE, &brake) ||
        !as_row(given[3], NPY_DOUBLE, &grip) || !as_row(given[4], NPY_DOUBLE, &past) ||
        !as_row(given[5], NPY_DOUBLE, &coming) || !as_numbers(given + 6, 9, (double *)&car))
        return NULL;
    int fine = all_finite(&steering) && all_finite(&grip) && all_finite(&past) && all_finite(&coming) && car.brake >= 0;
    for (int i = 0; i < 9; i++)
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
    for (beam i = 0; answer && i < steering.count; i++) {
        struct state path[STEPS + 1];
        struct end ends[MANOEUVRE_ROLLOUT_MAX_FLOORS][MOST_ENDS];
        int moments = 0;
        for (beam f = 0; f < grip.count; f++) {
            roll_out(&car, &past, &coming, NUMBER(steering, i), NUMBER(brake, i), NUMBER(grip, f), path);
            moments = ends_of(&car, path, &points, NUMBER(brake, i), NUMBER(grip, f), margin, ends[f]);
        }
        best_end(ends, grip.count, moments, DATA(double, answer) + i * (grip.count + 1));
    }
    free(room);
    return answer;
}
