/* Twins of runtime/control/prediction.py, speed_profile.py and ball_path.py's bend: loops over a few numbers. */

#include "arrays.h"
#include "constants.h"

/* rolled_ahead(motion, steering, coming, steps) -> x, y, yaw
 * motion: speed, wheelbase, trim, slew rate, way of one step in seconds. steering: angle, target. coming: (time after
 * the beginning, angle) in order. */
KERNEL(rolled_ahead) {
    double motion[MOST_NUMBERS], steering[MOST_NUMBERS], times[MOST_NUMBERS], angles[MOST_NUMBERS];
    beam steps;
    if (!enough(count, 4, "rolled_ahead") || !as_indices(given + 3, 1, &steps))
        return NULL;
    int motions = numbers_of(given[0], motion), angles_now = motions < 0 ? -1 : numbers_of(given[1], steering);
    if (angles_now < 0)
        return NULL;
    if (motions != 5 || angles_now != 2 || !PyList_Check(given[2]) || PyList_GET_SIZE(given[2]) > MOST_NUMBERS) {
        PyErr_SetString(PyExc_TypeError, "rolled_ahead wants 5 numbers, 2 numbers and a list of at most 32 pairs");
        return NULL;
    }
    int coming = (int)PyList_GET_SIZE(given[2]), next = 0;
    for (int i = 0; i < coming; i++) {
        double pair[MOST_NUMBERS];
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
    double radius[MOST_NUMBERS], bearing[MOST_NUMBERS], x[4], y[4];
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

/* fastest_mps(radii, bearings, meets, crosses, speed, mu) -> speed, of the circles that the path crosses */
KERNEL(fastest_mps) {
    double radii[MOST_NUMBERS], bearings[MOST_NUMBERS], meets[MOST_NUMBERS], crosses[MOST_NUMBERS], v[2];
    double heading[MOST_NUMBERS], way[MOST_NUMBERS + 1];
    if (!enough(count, 6, "fastest_mps") || !as_numbers(given + 4, 2, v))
        return NULL;
    int all = numbers_of(given[0], radii);
    if (all < 0 || !same_count(given[1], all, bearings) || !same_count(given[2], all, meets) ||
        !same_count(given[3], all, crosses))
        return NULL;
    int begin = 0, end;
    all = all < SPEED_PROFILE_CIRCLES ? all : SPEED_PROFILE_CIRCLES;
    while (begin < all && !crosses[begin])
        begin++;
    for (end = begin; end < all && meets[end];)
        end++;
    double margin = SPEED_PROFILE_MARGIN_M + SPEED_PROFILE_REACTION_S * fabs(v[0]);
    double lateral = SPEED_PROFILE_LATERAL_SHARE * v[1] * SPEED_PROFILE_GRAVITY_MPS2;
    double brake = SPEED_PROFILE_BRAKE_SHARE * v[1] * SPEED_PROFILE_GRAVITY_MPS2;
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
    double square = lateral / SPEED_PROFILE_SHARPEST_PER_M + 2 * brake * most(way[chords] - margin, 0.0);
    const int span = SPEED_PROFILE_SPAN;
    for (int i = 0; i < chords - span; i++) {
        double turn = fabs(remainder(heading[i + span] - heading[i], 2 * Py_MATH_PI));
        double bend = within(turn / most(way[i + 1 + span] - way[i + 1], 1e-3), 1e-3, SPEED_PROFILE_SHARPEST_PER_M);
        square = least(square, lateral / bend + 2 * brake * most(way[i + 1] - margin, 0.0));
    }
    return PyFloat_FromDouble(sqrt(square));
}

/* only_one(told, angle) -> place in told, a tuple of (time, angle), or -1 */
KERNEL(only_one) {
    double angle, pair[MOST_NUMBERS];
    if (!enough(count, 2, "only_one") || !as_numbers(given + 1, 1, &angle))
        return NULL;
    if (!PyTuple_Check(given[0])) {
        PyErr_SetString(PyExc_TypeError, "only_one wants a tuple of pairs");
        return NULL;
    }
    Py_ssize_t found = -1, many = 0;
    for (Py_ssize_t i = 0; i < PyTuple_GET_SIZE(given[0]); i++) {
        if (!same_count(PyTuple_GET_ITEM(given[0], i), 2, pair))
            return NULL;
        if (fabs(pair[1] - angle) < PREDICTION_SAME_RAD) {
            found = i;
            many++;
        }
    }
    return PyLong_FromSsize_t(many == 1 ? found : -1);
}
