/* Where beams end: the geometry of sim/world/free_rectangles.py and sim/world/segments.py, LANES beams at a time.
 *
 * Optional, a part of the extension module (runtime/kernel); numpy does the same without it, see sim/world/compiled.py and
 * docs/decisions/0012-fast-simulator.md. Loops over the lanes have no branches and keep whole numbers (cells) as
 * doubles, which are exact beyond the size of any map, so that a compiler turns them into vector instructions.
 * Units: metres, radians, cells. No beam is looked at twice, nothing is kept between calls.
 */

#include "arrays.h"
#include "constants.h"

#include <stdint.h>

#define LANES 64
#define FEW 8
#define MAX_BEARING 1e9 /* quarters of a turn are counted in 32 bits */
#define EACH_LANE for (int k = 0; k < LANES; k++)
#define MIN(a, b) ((a) < (b) ? (a) : (b))
#define MAX(a, b) ((a) > (b) ? (a) : (b))

/* Beams of one call. x, y: an origin for each beam, or NULL when all start at x0, y0. */
struct beams {
    double x0, y0;
    const double *x, *y, *bearing;
    double *ranges;
    int64_t count;
};

/* A grid in the world: its corner, the cosine and sine of its yaw, the edge of a cell; four planes of leaps follow
 * each other, width + 256 height of each cell's free rectangle. */
struct cells {
    double x, y, cos, sin, yaw, cell_m, rows, columns;
    const uint16_t *leaps;
};

/* Straight walls, five numbers each (one end, unit direction, half length), and circles, three each. */
struct walls {
    const double *straight, *circles;
    int64_t straight_count, circle_count;
};

/* Cosine and sine, good to 2e-16: taken back to +-pi/4, then Taylor's series. */
static inline void directions(const double *restrict angle, double *restrict dx, double *restrict dy)
{
    EACH_LANE {
        double quarter = rint(angle[k] * 0.63661977236758134308);
        double r = angle[k] - quarter * 1.5707963267341256142; /* pi/2 in three parts; the first has 33 bits */
        r -= quarter * 6.0771005063039659e-11;
        r -= quarter * 2.0222662487959506e-21;
        double z = r * r;
        double s = r + r * z * (-1.0 / 6 + z * (1.0 / 120 + z * (-1.0 / 5040 + z * (1.0 / 362880 + z * (-1.0 / 39916800
                 + z * (1.0 / 6227020800.0 + z * (-1.0 / 1307674368000.0 + z * (1.0 / 355687428096000.0))))))));
        double c = 1.0 - z / 2 + z * z * (1.0 / 24 + z * (-1.0 / 720 + z * (1.0 / 40320 + z * (-1.0 / 3628800
                 + z * (1.0 / 479001600.0 + z * (-1.0 / 87178291200.0 + z * (1.0 / 20922789888000.0)))))));
        int turn = (int)quarter;
        double sine = turn & 1 ? c : s, cosine = turn & 1 ? s : c;
        dy[k] = turn & 2 ? -sine : sine;
        dx[k] = (turn + 1) & 2 ? -cosine : cosine;
    }
}

static inline int is_angle(const struct beams *beams, int64_t at) { return fabs(beams->bearing[at]) < MAX_BEARING; }

/* Copy the bearings of the next beams, and their origins if each has its own; return how many there are. What the lanes
 * without a beam hold is of no interest, but it is a number. */
static inline int take(const struct beams *beams, int64_t first, double *restrict ox, double *restrict oy,
                       double *restrict angle)
{
    int some = (int)MIN(beams->count - first, LANES);
    EACH_LANE { ox[k] = beams->x0; oy[k] = beams->y0; angle[k] = 0.0; }
    for (int k = 0; k < some; k++) angle[k] = is_angle(beams, first + k) ? beams->bearing[first + k] : 0.0;
    if (beams->x)
        for (int k = 0; k < some; k++) { ox[k] = beams->x[first + k]; oy[k] = beams->y[first + k]; }
    return some;
}

/* World to cells. */
static inline double column_of(const struct cells *grid, double x, double y)
{
    return (grid->cos * (x - grid->x) + grid->sin * (y - grid->y)) / grid->cell_m;
}

static inline double row_of(const struct cells *grid, double x, double y)
{
    return (grid->cos * (y - grid->y) - grid->sin * (x - grid->x)) / grid->cell_m;
}

/* What is known of LANES beams on their way, in cells: places, unit directions and their inverses, the edge of its own
 * cell that a beam meets (0 or 1), its step along rows and columns (1 or -1), its plane of leaps, where it is. */
struct lanes {
    double px[LANES], py[LANES], dx[LANES], dy[LANES], per_x[LANES], per_y[LANES], far_x[LANES], far_y[LANES];
    double sign_x[LANES], sign_y[LANES], plane[LANES], column[LANES], row[LANES], now[LANES];
};

static inline int cell_of(const struct lanes *at, int k, double columns)
{
    return (int)(at->plane[k] + at->row[k] * columns + at->column[k]);
}

/* Go to where the beam leaves its free rectangle; a leap of 0 stays. The axis that was crossed steps exactly; the other
 * may not be rounded out of the rectangle. */
static inline void go(struct lanes *at, int k, int leap)
{
    double px = at->px[k], py = at->py[k], column = at->column[k], row = at->row[k];
    double sign_x = at->sign_x[k], sign_y = at->sign_y[k], width = leap & 255, height = leap >> 8;
    double last_x = column + sign_x * (width - 1.0), last_y = row + sign_y * (height - 1.0);
    double until_x = (last_x + at->far_x[k] - px) * at->per_x[k], until_y = (last_y + at->far_y[k] - py) * at->per_y[k];
    int by_x = until_x < until_y, goes = leap > 0;
    double then = MIN(until_x, until_y), aside_x = floor(px + then * at->dx[k]), aside_y = floor(py + then * at->dy[k]);
    aside_x = MIN(MAX(aside_x, MIN(column, last_x)), MAX(column, last_x));
    aside_y = MIN(MAX(aside_y, MIN(row, last_y)), MAX(row, last_y));
    double next_x = by_x ? last_x + sign_x : aside_x, next_y = by_x ? aside_y : last_y + sign_y;
    at->now[k] = goes ? then : at->now[k];
    at->column[k] = goes ? next_x : column;
    at->row[k] = goes ? next_y : row;
}

/* Leap from free rectangle to free rectangle until the first solid cell; 0 from inside one. */
static void through_cells(const struct cells *grid, const struct beams *beams)
{
    const uint16_t *leaps = grid->leaps;
    const double rows = grid->rows, columns = grid->columns;
    const double along_grid = GRID_ALONG_GRID;
    const double px0 = column_of(grid, beams->x0, beams->y0), py0 = row_of(grid, beams->x0, beams->y0);
    for (int64_t first = 0; first < beams->count; first += LANES) {
        double ox[LANES], oy[LANES], angle[LANES];
        struct lanes at;
        int some = take(beams, first, ox, oy, angle);
        EACH_LANE { angle[k] -= grid->yaw; at.px[k] = px0; at.py[k] = py0; }
        if (beams->x)
            EACH_LANE { at.px[k] = column_of(grid, ox[k], oy[k]); at.py[k] = row_of(grid, ox[k], oy[k]); }
        directions(angle, at.dx, at.dy);
        EACH_LANE {
            double dx = fabs(at.dx[k]) < along_grid ? 0.0 : at.dx[k], dy = fabs(at.dy[k]) < along_grid ? 0.0 : at.dy[k];
            double far_x = dx >= 0.0 ? 1.0 : 0.0, far_y = dy >= 0.0 ? 1.0 : 0.0; /* along a grid line: +0.0, not -0.0 */
            int inside = (at.px[k] >= 0.0) & (at.py[k] >= 0.0) & (at.px[k] < columns) & (at.py[k] < rows);
            at.dx[k] = dx; at.dy[k] = dy;
            at.per_x[k] = 1.0 / dx; at.per_y[k] = 1.0 / dy;
            at.far_x[k] = far_x; at.far_y[k] = far_y;
            at.sign_x[k] = 2.0 * far_x - 1.0; at.sign_y[k] = 2.0 * far_y - 1.0;
            at.plane[k] = rows * columns * (3.0 - 2.0 * far_x - far_y);
            at.column[k] = inside ? floor(at.px[k]) : 0.0; /* outside and the grid's rim are solid */
            at.row[k] = inside ? floor(at.py[k]) : 0.0;
            at.now[k] = 0.0;
        }
        int cell[LANES], leap[LANES], going;
        do {
            going = 0;
            EACH_LANE cell[k] = cell_of(&at, k, columns);
            EACH_LANE leap[k] = leaps[cell[k]];
            EACH_LANE going += leap[k] > 0;
            EACH_LANE go(&at, k, leap[k]);
        } while (going > FEW);
        for (int k = 0; going && k < LANES; k++) /* the last few one at a time */
            while (leap[k] && (leap[k] = leaps[cell_of(&at, k, columns)]))
                go(&at, k, leap[k]);
        for (int k = 0; k < some; k++) beams->ranges[first + k] = is_angle(beams, first + k) ? at.now[k] * grid->cell_m : NAN;
    }
}

/* Meet all walls and circles; INFINITY where there is none. Ray o + t d and wall p + s e, with r = p - o, meet at
 * t = r x e / d x e and s = r x d / d x e. */
static void to_walls(const struct walls *walls, const struct beams *beams)
{
    for (int64_t first = 0; first < beams->count; first += LANES) {
        double ox[LANES], oy[LANES], angle[LANES], dx[LANES], dy[LANES], nearest[LANES];
        int some = take(beams, first, ox, oy, angle);
        directions(angle, dx, dy);
        EACH_LANE nearest[k] = INFINITY;
        for (int64_t i = 0; i < walls->straight_count; i++) {
            const double *wall = walls->straight + 5 * i;
            const double x = wall[0], y = wall[1], ex = wall[2], ey = wall[3], half = wall[4];
            const double reach = half + SEGMENTS_END_SLACK_M, edge_on = SEGMENTS_EDGE_ON;
            double away[LANES], facing[LANES];
            int32_t meets[LANES], any = 0;
            EACH_LANE {
                double rx = x - ox[k], ry = y - oy[k];
                facing[k] = dx[k] * ey - dy[k] * ex;
                away[k] = rx * ey - ry * ex;
                double along = rx * dy[k] - ry * dx[k] - half * facing[k], size = fabs(facing[k]);
                meets[k] = (fabs(along) <= reach * size) & (away[k] * facing[k] >= 0.0) & (size > edge_on);
            }
            EACH_LANE any |= meets[k];
            if (!any)
                continue;
            EACH_LANE {
                double distance = away[k] / facing[k];
                nearest[k] = meets[k] & (distance < nearest[k]) ? distance : nearest[k];
            }
        }
        for (int64_t i = 0; i < walls->circle_count; i++) {
            const double *circle = walls->circles + 3 * i;
            const double x = circle[0], y = circle[1], radius = circle[2], square = radius * radius;
            EACH_LANE {
                double rx = x - ox[k], ry = y - oy[k];
                double along = rx * dx[k] + ry * dy[k], aside = rx * dy[k] - ry * dx[k];
                double distance = along - sqrt(MAX(square - aside * aside, 0.0));
                int inside = rx * rx + ry * ry <= square, meets = (fabs(aside) <= radius) & (along > 0.0);
                distance = inside ? 0.0 : meets ? distance : INFINITY;
                nearest[k] = MIN(nearest[k], distance);
            }
        }
        for (int k = 0; k < some; k++) beams->ranges[first + k] = is_angle(beams, first + k) ? nearest[k] : NAN;
    }
}

/* A contiguous array of this type; NULL with an error for anything else. */
static const void *whole(PyObject *object, int type, beam *count)
{
    struct row row;
    if (!as_row(object, type, &row))
        return NULL;
    if (row.count && !PyArray_IS_C_CONTIGUOUS((PyArrayObject *)object)) {
        PyErr_SetString(PyExc_ValueError, "casting wants contiguous arrays");
        return NULL;
    }
    *count = row.count;
    return row.data;
}

/* The origin of all beams, or of each. */
static int origins(PyObject *object, beam count, double *one, const double **each)
{
    beam found;
    if (!PyArray_Check(object))
        return as_numbers(&object, 1, one);
    *each = whole(object, NPY_DOUBLE, &found);
    if (*each && found != count)
        PyErr_SetString(PyExc_ValueError, "casting: arrays of different lengths");
    return *each && found == count;
}

/* given: x, y, bearing, ranges. */
static int beams_of(PyObject *const *given, struct beams *beams)
{
    beam count, room;
    *beams = (struct beams){.x0 = 0.0};
    beams->bearing = whole(given[2], NPY_DOUBLE, &count);
    beams->ranges = beams->bearing ? (double *)whole(given[3], NPY_DOUBLE, &room) : NULL;
    if (!beams->ranges || !origins(given[0], count, &beams->x0, &beams->x) || !origins(given[1], count, &beams->y0, &beams->y))
        return 0;
    beams->count = count;
    if (room != count || !beams->x != !beams->y || !PyArray_ISWRITEABLE((PyArrayObject *)given[3])) {
        PyErr_SetString(PyExc_ValueError, "casting: arrays of different lengths");
        return 0;
    }
    return !PyErr_Occurred();
}

/* cast_cells(leaps, (x, y, cos, sin, yaw, cell_m, rows, columns), x, y, bearing, ranges): fills ranges */
KERNEL(cast_cells)
{
    struct beams beams;
    struct cells grid;
    double v[MAX_NUMBERS];
    beam leaps;
    if (!enough(count, 6, "cast_cells") || !same_count(given[1], 8, v) || !beams_of(given + 2, &beams))
        return NULL;
    grid = (struct cells){v[0], v[1], v[2], v[3], v[4], v[5], v[6], v[7], whole(given[0], NPY_UINT16, &leaps)};
    if (!grid.leaps)
        return NULL;
    if (!(v[6] >= 1 && v[7] >= 1 && v[6] * v[7] * 4 == (double)leaps && leaps < INT32_MAX))
        return PyErr_Format(PyExc_ValueError, "cast_cells: four planes of rows by columns are needed");
    through_cells(&grid, &beams);
    Py_RETURN_NONE;
}

/* cast_walls(straight, circles, x, y, bearing, ranges): fills ranges */
KERNEL(cast_walls)
{
    struct beams beams;
    beam straight, circles;
    if (!enough(count, 6, "cast_walls") || !beams_of(given + 2, &beams))
        return NULL;
    const double *lines = whole(given[0], NPY_DOUBLE, &straight), *round = lines ? whole(given[1], NPY_DOUBLE, &circles) : NULL;
    if (!round)
        return NULL;
    if (straight % 5 || circles % 3)
        return PyErr_Format(PyExc_ValueError, "cast_walls: five numbers for a wall, three for a circle are needed");
    struct walls walls = {lines, round, straight / 5, circles / 3};
    to_walls(&walls, &beams);
    Py_RETURN_NONE;
}
