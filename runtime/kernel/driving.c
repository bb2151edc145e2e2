/* Twins of runtime/control/wall_following/prediction.py and odometry.py, and steps of speed_profile.py and ball_path.py. */

#include "arrays.h"
#include "constants.h"
#include "steps.h"

/* A steering answer, sent or in flight, and its time. */
struct answer {
    double at, angle;
};

/* The answers of a tuple of (time, angle); how many, or -1. */
static int answers_of(PyObject *told, struct answer *to) {
    if (!PyTuple_Check(told) || PyTuple_GET_SIZE(told) > PREDICTION_MAX_TOLD) {
        PyErr_Format(PyExc_TypeError, "the kernel wants a tuple of at most %d answers", PREDICTION_MAX_TOLD);
        return -1;
    }
    int count = (int)PyTuple_GET_SIZE(told);
    for (int i = 0; i < count; i++) {
        double pair[MAX_NUMBERS];
        if (!same_count(PyTuple_GET_ITEM(told, i), 2, pair))
            return -1;
        to[i] = (struct answer){pair[0], pair[1]};
    }
    return count;
}

enum { OBEYED, LEAST, MOST };

static void measure(double *wire, const struct answer *told, int count, double stamp, double angle) {
    int same = -1, many = 0;
    for (int i = 0; i < count; i++)
        if (fabs(told[i].angle - angle) < PREDICTION_SAME_RAD) {
            same = i;
            many++;
        }
    if (many != 1)
        return;
    wire[OBEYED] = stamp;
    double upper = stamp - told[same].at, lower = same + 1 < count ? greater(stamp - told[same + 1].at, 0.0) : 0.0;
    if (!(0.0 <= upper && upper <= PREDICTION_MAX_WIRE_S))
        return;
    int changed = upper < wire[LEAST] || lower > wire[MOST];
    wire[LEAST] = changed ? lower : greater(wire[LEAST], lower);
    wire[MOST] = changed ? upper : lesser(wire[MOST], upper);
}

static double towards(double from, double to, double most_rad) { return from + bounded(to - from, -most_rad, most_rad); }

/* predict_motion(told, (obeyed, least, most), motor's time, speed, steering, servo, scan's time, since, ahead, wheelbase,
 * trim, rate) -> (obeyed, least, most), servo, x, y, yaw */
KERNEL(predict_motion) {
    struct answer told[PREDICTION_MAX_TOLD];
    double wire[MAX_NUMBERS], v[10];
    if (!enough(count, 12, "predict_motion") || !same_count(given[1], 3, wire) || !as_numbers(given + 2, 10, v))
        return NULL;
    int all = answers_of(given[0], told);
    if (all < 0)
        return NULL;
    double now = v[0], speed = v[1], target = v[2], scan = v[4], ahead = v[6], wheelbase = v[7], trim = v[8];
    measure(wire, told, all, now, target);
    double servo = towards(v[3], target, v[9] * v[5]), to_wire = (wire[LEAST] + wire[MOST]) / 2;
    int next = all;
    if (!(now - wire[OBEYED] > PREDICTION_OBEYED_WITHIN_S))
        while (next > 0 && !(told[next - 1].at + to_wire <= now))
            next--;
    ahead += to_wire;
    double steps = rint(ahead / PREDICTION_STEP_S); /* of two as near, the even one, as Python's round */
    if (!isfinite(steps))
        return PyLong_FromDouble(steps); /* fails as round does */
    steps = most(steps, 1.0);
    double dt = ahead / steps, slew = v[9] * dt, angle = servo, x = 0, y = 0, yaw = 0;
    double most_rate = PREDICTION_GRIP_MU * PREDICTION_GRAVITY_MPS2 / greater(fabs(speed), PREDICTION_MIN_SPEED_MPS);
    for (double step = 0; step < steps; step++) {
        for (; next < all && told[next].at + to_wire - scan <= step * dt; next++)
            target = told[next].angle;
        angle = towards(angle, target, slew);
        double rate = bounded(speed * tan(angle + trim) / wheelbase, -most_rate, most_rate);
        double middle = yaw + rate * dt / 2;
        x += speed * cos(middle) * dt;
        y += speed * sin(middle) * dt;
        yaw += rate * dt;
    }
    return Py_BuildValue("((ddd)dddd)", wire[OBEYED], wire[LEAST], wire[MOST], servo, x, y, yaw);
}

/* The curvature of a path over four circles. */
double bend_of(const double *radius, const double *bearing) {
    double x[4], y[4];
    for (int i = 0; i < 4; i++) {
        x[i] = radius[i] * cos(bearing[i]);
        y[i] = radius[i] * sin(bearing[i]);
    }
    double turn = atan2(y[3] - y[2], x[3] - x[2]) - atan2(y[1] - y[0], x[1] - x[0]);
    double way = (hypot(x[2] - x[0], y[2] - y[0]) + hypot(x[3] - x[1], y[3] - y[1])) / 2;
    return remainder(turn, 2 * Py_MATH_PI) / most(way, 1e-3);
}

/* The maximum speed now along the circles that the path crosses; see fastest_mps. */
double fastest(const double *radii, const double *bearings, const npy_bool *meets, const npy_bool *crosses, int all,
               double speed, double mu) {
    double heading[MAX_NUMBERS], way[MAX_NUMBERS + 1];
    int begin = 0, end;
    all = all < SPEED_PROFILE_CIRCLES ? all : SPEED_PROFILE_CIRCLES;
    while (begin < all && !crosses[begin])
        begin++;
    for (end = begin; end < all && meets[end];)
        end++;
    double margin = SPEED_PROFILE_MARGIN_M + SPEED_PROFILE_REACTION_S * fabs(speed);
    double lateral = SPEED_PROFILE_LATERAL_SHARE * mu * SPEED_PROFILE_GRAVITY_MPS2;
    double brake = SPEED_PROFILE_BRAKE_SHARE * mu * SPEED_PROFILE_GRAVITY_MPS2;
    int circles = end - begin, chords = circles > 1 ? circles - 1 : 0;
    const double *radius = radii + begin, *bearing = bearings + begin;
    way[0] = chords ? radius[0] : 0.0;
    double x0 = 0, y0 = 0;
    for (int i = 0; i < circles; i++) {
        double x1 = radius[i] * cos(bearing[i]), y1 = radius[i] * sin(bearing[i]);
        if (i) {
            heading[i - 1] = atan2(y1 - y0, x1 - x0);
            way[i] = way[i - 1] + hypot(x1 - x0, y1 - y0);
        }
        x0 = x1;
        y0 = y1;
    }
    double turned = 0.0;
    for (int i = 0; i < chords; i++)
        turned = greater(turned, fabs(remainder(heading[i] - heading[0], 2 * Py_MATH_PI)));
    double back = (turned - SPEED_PROFILE_BACK_FROM_RAD) / (SPEED_PROFILE_BACK_WHOLE_RAD - SPEED_PROFILE_BACK_FROM_RAD);
    double sharpest = SPEED_PROFILE_SHARPEST_PER_M +
                      bounded(back, 0.0, 1.0) * (SPEED_PROFILE_BACK_PER_M - SPEED_PROFILE_SHARPEST_PER_M);
    double square = lateral / sharpest + 2 * brake * greater(way[chords] - margin, 0.0);
    const int span = SPEED_PROFILE_SPAN;
    for (int i = 0; i < chords - span; i++) {
        double turn = fabs(remainder(heading[i + span] - heading[i], 2 * Py_MATH_PI));
        double bend = turn / greater(way[i + 1 + span] - way[i + 1], 1e-3);
        bend = bounded(bend, 1e-3, sharpest);
        square = lesser(square, lateral / bend + 2 * brake * greater(way[i + 1] - margin, 0.0));
    }
    return sqrt(square);
}

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
