/* Steps shared by several functions of the kernel; each is described where it is defined. */

#ifndef WALLRIDE_STEPS_H
#define WALLRIDE_STEPS_H

#include "arrays.h"

struct wall_line {
    double distance_m, heading_rad;
    beam inliers;
};

enum found { FAILED = -1, NONE, FOUND };

/* scan_on_lines.c. Solves m x = -y, m (3, 3); 0 with ValueError for a singular one. */
int solve_three(const double *m, const double *y, double *x);

/* What the points that fit their lines tell of the pose; fits of those that have one. */
struct told {
    double information[9], pull[3];
    beam fits, lines;
};

/* scan_matching.c */
beam beam_toward(double x, double y, double first, double step, beam count);
void tell(struct told *told, place normal, place turned, double off, double weight);

/* wall_fit.c. expected: distance and heading, NaN where no line is expected. */
enum found find_line(const struct row *x, const struct row *y, const struct row *range, const struct row *usable,
                     const struct row *beams, const struct row *rear, const struct row *front, const double *expected,
                     struct wall_line *line);

/* followed_wall.c. Puts the places where the caller frees them, with room for this many more; how many, or -1. */
beam outline_of(const struct row *x, const struct row *y, const struct row *wall, beam more, place **to);

/* speed_profile.c */
double fastest(const double *radius, const double *bearing, const npy_bool *meets, const npy_bool *crosses, int circles,
               double speed, double mu);

/* Inputs of the steering besides the ball's path; see pursuit_steering. */
struct aim {
    double error, heading, straight, steering;
};

/* ball_law.c. v: error, line_rad, line_error, mean_bend, speed, kp, kd, wheelbase. */
struct aim pursue(const double *radius, const double *bearing, const npy_bool *crosses, int circles, const double *v);

#endif
