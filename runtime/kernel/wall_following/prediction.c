/* Twin of runtime/control/wall_following/prediction.py: the motion until a command takes effect. */

#include "arrays.h"
#include "constants.h"

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
    double most_rate = PREDICTION_GRIP_MU * VEHICLE_GRAVITY_MPS2 / greater(fabs(speed), PREDICTION_MIN_SPEED_MPS);
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
