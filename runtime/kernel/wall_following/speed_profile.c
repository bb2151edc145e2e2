/* Step of runtime/control/wall_following/speed_profile.py: the speed for the bends ahead. */

#include "arrays.h"
#include "constants.h"
#include "steps.h"

/* The maximum speed now along the circles that the path crosses; see fastest_mps. */
double fastest(const double *radii, const double *bearings, const npy_bool *meets, const npy_bool *crosses, int all,
               double speed, double mu) {
    double heading[MAX_NUMBERS], way[MAX_NUMBERS + 1];
    const int most_circles = (int)SPEED_PROFILE_CIRCLES;
    int begin = 0, end;
    all = all < most_circles ? all : most_circles;
    while (begin < all && !crosses[begin])
        begin++;
    for (end = begin; end < all && meets[end];)
        end++;
    double margin = SPEED_PROFILE_MARGIN_M + SPEED_PROFILE_REACTION_S * fabs(speed);
    double lateral = SPEED_PROFILE_LATERAL_SHARE * mu * VEHICLE_GRAVITY_MPS2;
    double brake = SPEED_PROFILE_BRAKE_SHARE * mu * VEHICLE_GRAVITY_MPS2;
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
    const int span = (int)SPEED_PROFILE_SPAN;
    for (int i = 0; i < chords - span; i++) {
        double turn = fabs(remainder(heading[i + span] - heading[i], 2 * Py_MATH_PI));
        double bend = turn / greater(way[i + 1 + span] - way[i + 1], 1e-3);
        bend = bounded(bend, 1e-3, sharpest);
        square = lesser(square, lateral / bend + 2 * brake * greater(way[i + 1] - margin, 0.0));
    }
    return sqrt(square);
}
