/* Twins of runtime/control/prediction.py, speed_profile.py and ball_path.py's bend: loops over a few numbers. */

#include "arrays.h"
#include "constants.h"

#define CIRCLES 32

/* Read a tuple of at most `most` numbers; -1 with TypeError when it is none. */
static int numbers_of(PyObject *tuple, double *to) {
    if (!PyTuple_Check(tuple) || PyTuple_GET_SIZE(tuple) > CIRCLES) {
        PyErr_SetString(PyExc_TypeError, "the kernel wants a tuple of at most 32 numbers");
        return -1;
    }
    int count = (int)PyTuple_GET_SIZE(tuple);
    for (int i = 0; i < count; i++) {
        PyObject *one = PyTuple_GET_ITEM(tuple, i);
        if (!as_numbers(&one, 1, to + i))
            return -1;
    }
    return count;
}

static double within(double value, double least_value, double most_value) {
    return least(most(value, least_value), most_value);
}

/* rolled_ahead(motion, steering, coming, steps) -> x, y, yaw
 * motion: speed, wheelbase, trim, slew rate, way of one step in seconds. steering: angle, target. coming: (time after
 * the beginning, angle) in order. */
KERNEL(rolled_ahead) {
    double motion[CIRCLES], steering[CIRCLES], times[CIRCLES], angles[CIRCLES];
    beam steps;
    if (!enough(count, 4, "rolled_ahead") || !as_indices(given + 3, 1, &steps))
        return NULL;
    int motions = numbers_of(given[0], motion), angles_now = motions < 0 ? -1 : numbers_of(given[1], steering);
    if (angles_now < 0)
        return NULL;
    if (motions != 5 || angles_now != 2 || !PyList_Check(given[2]) || PyList_GET_SIZE(given[2]) > CIRCLES) {
        PyErr_SetString(PyExc_TypeError, "rolled_ahead wants 5 numbers, 2 numbers and a list of at most 32 pairs");
        return NULL;
    }
    int coming = (int)PyList_GET_SIZE(given[2]), next = 0;
    for (int i = 0; i < coming; i++) {
        double pair[CIRCLES];
        int size = numbers_of(PyList_GET_ITEM(given[2], i), pair);
        if (size != 2) {
            if (size >= 0)
                PyErr_SetString(PyExc_TypeError, "rolled_ahead wants pairs of time and angle");
            return NULL;
        }
        times[i] = pair[0];
        angles[i] = pair[1];
    }
    double speed = motion[0], wheelbase = motion[1], trim = motion[2], slew = motion[3] * motion[4], dt = motion[4];
    double angle = steering[0], target = steering[1], x = 0, y = 0, yaw = 0;
    double most_rate = PREDICTION_GRIP_MU * PREDICTION_GRAVITY_MPS2 / most(fabs(speed), PREDICTION_SLOWEST_MPS);
    for (beam step = 0; step < steps; step++) {
        while (next < coming && times[next] <= (double)step * dt)
            target = angles[next++];
        angle += within(target - angle, -slew, slew);
        double rate = within(speed * tan(angle + trim) / wheelbase, -most_rate, most_rate);
        double middle = yaw + rate * dt / 2;
        x += speed * cos(middle) * dt;
        y += speed * sin(middle) * dt;
        yaw += rate * dt;
    }
    return Py_BuildValue("(ddd)", x, y, yaw);
}

/* bend_of(radii, bearings) -> curvature, of four circles */
KERNEL(bend_of) {
    double radius[CIRCLES], bearing[CIRCLES], x[4], y[4];
    if (!enough(count, 2, "bend_of"))
        return NULL;
    int radii = numbers_of(given[0], radius), bearings = radii < 0 ? -1 : numbers_of(given[1], bearing);
    if (bearings < 0)
        return NULL;
    if (radii != 4 || bearings != 4) {
        PyErr_SetString(PyExc_TypeError, "bend_of wants four circles");
        return NULL;
    }
    for (int i = 0; i < 4; i++) {
        x[i] = radius[i] * cos(bearing[i]);
        y[i] = radius[i] * sin(bearing[i]);
    }
    double turn = atan2(y[3] - y[2], x[3] - x[2]) - atan2(y[1] - y[0], x[1] - x[0]);
    double way = (hypot(x[2] - x[0], y[2] - y[0]) + hypot(x[3] - x[1], y[3] - y[1])) / 2;
    return PyFloat_FromDouble(remainder(turn, 2 * Py_MATH_PI) / most(way, 1e-3));
}

/* fastest_mps(radii, bearings, margin, lateral, brake) -> speed, of the circles that the path crosses */
KERNEL(fastest_mps) {
    double radius[CIRCLES], bearing[CIRCLES], v[3], heading[CIRCLES], way[CIRCLES + 1];
    if (!enough(count, 5, "fastest_mps") || !as_numbers(given + 2, 3, v))
        return NULL;
    int circles = numbers_of(given[0], radius), bearings = circles < 0 ? -1 : numbers_of(given[1], bearing);
    if (bearings < 0)
        return NULL;
    if (circles != bearings) {
        PyErr_SetString(PyExc_TypeError, "fastest_mps wants as many bearings as radii");
        return NULL;
    }
    double margin = v[0], lateral = v[1], brake = v[2];
    way[0] = circles > 1 ? radius[0] : 0.0;
    int chords = circles > 1 ? circles - 1 : 0;
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
    double square = lateral / SPEED_PROFILE_SHARPEST_PER_M + 2 * brake * most(way[chords] - margin, 0.0);
    const int span = SPEED_PROFILE_SPAN;
    for (int i = 0; i < chords - span; i++) {
        double turn = fabs(remainder(heading[i + span] - heading[i], 2 * Py_MATH_PI));
        double bend = within(turn / most(way[i + 1 + span] - way[i + 1], 1e-3), 1e-3, SPEED_PROFILE_SHARPEST_PER_M);
        square = least(square, lateral / bend + 2 * brake * most(way[i + 1] - margin, 0.0));
    }
    return PyFloat_FromDouble(sqrt(square));
}
