/* The numeric functions of a step: plain arrays in, plain arrays out.
 *
 * Each file holds the functions of the Python kernel of its name, which say what they mean. Arrays
 * are row by row, without gaps; what is written never overlaps what is read. Nothing is allocated,
 * and only math.h is used. `real` is double; -DKMPC_FLOAT makes it float, with float's literals (R)
 * and functions (M).
 */
#ifndef KMPC_KERNELS_H
#define KMPC_KERNELS_H

#ifdef KMPC_FLOAT
typedef float real;
#define R(literal) literal##f
#define M(function) function##f
#else
typedef double real;
#define R(literal) literal
#define M(function) function
#endif

#ifndef KMPC_HORIZON
#define KMPC_HORIZON 200 /* stages at most */
#endif

enum {
    KMPC_INPUTS = 3,   /* commands at most: speed, turn rate; or two speeds and the turn rate */
    KMPC_THING = 7,    /* x, y, radius, vx, vy, spread rate, largest spread */
    KMPC_CIRCLE = 5,   /* x, y, radius, vx, vy */
    KMPC_TRACK = 39,   /* as of kernels/tracks.py */
    KMPC_DIRECTIONS = 2048 /* told apart around a scanner */
};

/* ---- predictor.c: a symmetric model of a robot that answers late and slips -------------------- */

struct kmpc_predictor {
    int commands, ages;             /* numbers of a command, m; that act in a period, L + 1 */
    int groups, terms;              /* sets of terms, each of commands filtered otherwise */
    int nodes;                      /* stages of the integrator */
    int steered;                    /* whether turn rates follow from filtered curvatures */
    const int *term;                /* (terms,) of a set; the first m are the speeds themselves */
    const real *kernel;             /* (groups, ages, m) weights of commands, newest first */
    const real *smoothing, *limits; /* (m,) eps of |s|; largest speeds that terms follow */
    const real *motion;             /* (groups, terms, 3) to where each leads: ahead, left, round */
    const real *node;               /* (nodes, 2) node and weight of each stage */
    const real *state, *command;    /* (3,), (m,) metres, radians and seconds of a unit */
};

struct kmpc_sent {
    const real *now;   /* (m,) a command; `driven` more lie before it in the same array */
    const real *past;  /* (L, m) those before that, oldest first; null: zeros */
    int driven;
    int zeros;         /* how many that are zero follow it: these are the newest */
};

int kmpc_terms(int commands); /* how many terms there are */
/* Of `count` commands, then zeros. */
void kmpc_rollout(const struct kmpc_predictor *p, int periods, int count, const real *x0,
                  const real *u, const real *past, real *states);
/* The next state, and its Jacobians but where `by_x` is null. */
void kmpc_linearize(const struct kmpc_predictor *p, const real *x, const struct kmpc_sent *sent,
                    real *value, real *by_x, real *by_u, real *by_past);

/* ---- clearance.c: distances from a table of things ------------------------------------------- */

void kmpc_distances(int things, const real *thing, int motions, int samples, int places,
                    int sampled, const real *points, const real *times, real *distance);
void kmpc_distances_and_directions(int things, const real *thing, int count, const real *points,
                                   const real *times, real *distance, real *away);

/* ---- brakes.c: motions that end at rest ------------------------------------------------------ */

struct kmpc_brakes {
    int commands, longest;       /* m; periods of a brake at most */
    const real *step;            /* (m,) by which a braked command shrinks in a period */
    const real *faster, *slower; /* (m,) by which commands may change away from zero, towards it */
    real curvature;              /* that wheels can be steered to; infinite without */
};

enum { KMPC_SLOWER = 14 }; /* coming commands that are tried instead of a plan's */

struct kmpc_batch { /* candidates, the best first */
    const struct kmpc_brakes *brakes;
    const real *inputs;                   /* (stages, m) of the plan */
    int stages, further;                  /* how many further commands of it are tried */
    int whole, at_once;                   /* with its coming command; whether it can stand then */
    int count, periods, length;           /* of candidates, their commands, their brakes */
    real first[KMPC_SLOWER][KMPC_INPUTS]; /* slower commands */
};

struct kmpc_tried { /* of one: must keep its margins; begins with a turn alone; stands by then */
    int strict, turns, ends;
};

/* Commands that brake after one, the last zero; how many. */
int kmpc_ramp(const struct kmpc_brakes *b, const real *command, real *ramp);
/* Count candidates, and write one (periods, m); `hardest` (m,) brakes hardest in a period. */
void kmpc_candidates(struct kmpc_batch *batch, const real *hardest);
void kmpc_candidate(const struct kmpc_batch *batch, int i, real *commands, struct kmpc_tried *kind);

/* ---- boxes.c: rectangles along the axes ------------------------------------------------------ */

void kmpc_box_distances(int boxes, const real *low, const real *high, int count,
                        const real *points, real *least);
void kmpc_nearest_boxes(int boxes, const real *low, const real *high, int count,
                        const real *points, real behind, int columns, real *room, long *chosen,
                        real *distance, real *normals);

/* ---- tube.c: margins of a plan --------------------------------------------------------------- */

struct kmpc_noise {
    int delay;                     /* periods until feedback acts */
    const real *white;             /* (2, 3, 3) covariance of a period, by v^2 and omega^2 */
    const real *lasting;           /* (2, 3) deviations of errors that last, by v and omega */
    const real *pose, *pose_speed; /* (3, 3) covariance of a measured pose, and by v^2 */
    real quantile;                 /* standard deviations that are kept */
    real headway_time;             /* time of driving on that is the least margin [s] */
    real touch;                    /* radius at which chords cut [m] */
    real reach;                    /* how far the outline lies from the pose [m] */
    real solver_margin;            /* added to all [m] */
    int spreads;                   /* whether there is any noise in a plan */
};

void kmpc_tube_margins(const struct kmpc_noise *noise, int stages, int columns, int row,
                       int directions, const real *by_x, const real *states, const real *inputs,
                       const real *normals, const real *path_clearance, real *margins);

/* ---- half_planes.c: what a plan must be kept out of, and the nearest few of a stage ---------- */

struct kmpc_keep_out {
    int places, things, solids, sides; /* circles of the outline; of the area */
    int directions;                    /* 2, or 3 of a robot that is not round */
    const real *thing;                 /* (things, 7) */
    const real *points;                /* (stages, places, 2) middles of these circles */
    const real *gaps, *away;           /* (stages, places, solids), and slopes (..., directions) */
    const real *side_normal, *side_offset;
    real distance, dt;                 /* radius with margin; period */
    real range;                        /* how far from the robot all is known; infinite: always */
};

int kmpc_kinds(const struct kmpc_keep_out *keep); /* columns of the following */
void kmpc_clearances(const struct kmpc_keep_out *keep, int stages, const real *states,
                     real *clearances, real *normals);
void kmpc_nearest_half_planes(int stages, int kinds, int slots, int directions, const real *states,
                              const real *clearances, const real *normals, real *chosen,
                              real *offsets);

/* ---- fill.c: the numbers of a pass's QP ------------------------------------------------------ */

struct kmpc_layout {
    int stages, inputs, history, slots, directions;
    real half_plane_scale, open;
};

struct kmpc_plan_margins {
    struct kmpc_noise noise;
    const real *speeds;          /* (stages, noise.inputs) */
    const real *path_clearance;  /* (stages,) */
    real widest, far_clearance, side_margin;
};

struct kmpc_pass { /* and what the model says of it */
    const real *states, *inputs, *reference;
    const real *value, *by_x, *by_u, *by_past;
    const real *weight, *weight_terminal; /* (3, 3) by which references enter `pull` */
    real turn_weight; /* of a heading, in the quadratic cost */
    int to_goal;      /* whether the reference is the goal itself, however far, at every stage */
};

struct kmpc_qp { /* what is written */
    const int *places;
    real *entries, *dynamics_lower, *dynamics_upper, *half_plane_lower, *pull, *start;
    real *turn; /* (stages - 1) in the quadratic cost: of each heading but the last */
};

/* Numbers that `room` holds. */
long kmpc_fill_room(const struct kmpc_layout *size, int kinds);
void kmpc_fill(const struct kmpc_layout *size, const struct kmpc_keep_out *keep,
               const struct kmpc_plan_margins *margins, const struct kmpc_pass *plan,
               const struct kmpc_qp *qp, real *room);

/* ---- stop_errors.c: what errors of single periods add up to ---------------------------------- */

void kmpc_stop_errors(int motions, int periods, real dt, const real *distances, const real *turns,
                      const real *position, const real *heading, real rare, real usual, real reach,
                      real *errors);

/* ---- safe_motion.c: which motions stay clear ------------------------------------------------- */

void kmpc_samples(int motions, int periods, int count, const real *states, real *poses);
void kmpc_between_samples(int motions, int samples, int places, int things, const real *clearance,
                          const real *standing, const real *at, const real *begin, real radius,
                          real *out);
void kmpc_surely_clear(int motions, int samples, int cells, const real *clearance,
                       const real *margins, const real *error, const real *travel, const int *ends,
                       real lost, unsigned char *clear);
void kmpc_admissible(int motions, int samples, int places, int things, int first,
                     const real *clearance, const real *standing, const real *spend,
                     const real *margins, const real *driven, const real *error,
                     const unsigned char *turns, const unsigned char *strict, const int *ends,
                     real unsure, unsigned char *clear);

/* ---- following.c: where on its path a robot is, and what it follows from there --------------- */

struct kmpc_timed {
    int poses, cusps;
    const real *pose;   /* (poses, 3), two at least */
    const real *time;   /* (poses) from zero on, growing; the last turn begins at the last but one */
    const real *cusp;   /* (cusps) when the gear changes */
    real step, braking; /* time between places that are looked at; of braking at the end */
};

real kmpc_nearest_turn(real angle);
void kmpc_pose_at(const struct kmpc_timed *path, real time, real *pose);
real kmpc_leg_end(const struct kmpc_timed *path, real begin);
/* `found` holds the time of the pose that is nearest, and the distance from it. */
void kmpc_locate(const struct kmpc_timed *path, const real *pose, real place, real least,
                 real *found);
void kmpc_along_path(const struct kmpc_timed *path, int count, const real *later, real place,
                     real leg, real heading, int turning, real *states);

/* ---- ways.c: shortest ways on a grid to a goal ------------------------------------------------ */

/* Cost of the way from each node, and the next node on it: -1 at the goal, and where no way is. A
 * step counts its length times the factor of its upper or left end; `room` holds two a node. */
void kmpc_ways(int height, int width, const unsigned char *usable, const real *factor, real step,
               int goal, real *cost, int *towards, int *room);

/* ---- clusters.c: small things in a scan ------------------------------------------------------ */

struct kmpc_ring {
    int beams;
    const real *reach;          /* (beams) how far each saw nothing */
    const real *ends;           /* (beams, 2) where it ends in the robot's frame */
    const unsigned char *hits;  /* (beams) */
    const unsigned char *clear; /* (beams) whether it saw that nothing is there */
    const real *mount;          /* (2) the scanner */
    real step, gap, largest;
};

int kmpc_clusters(const struct kmpc_ring *scan, int *ring, real *circles);

/* ---- tracks.c: circles that are followed ----------------------------------------------------- */

struct kmpc_walk {
    real dt, memory, acceleration, turning, noise, other, gate, chance;
};

struct kmpc_pairs { /* work space; rows are tracks, columns are circles */
    int *of_row, *row_of, *before, *done;      /* (rows), then (rows + columns) each */
    real *row_price, *column_price, *shortest; /* the same */
};

/* `costs` holds (tracks, circles); `after` the tracks before, and is overwritten. */
void kmpc_follow(const struct kmpc_walk *w, int tracks, int circles, const real *circle,
                 const real *source, struct kmpc_pairs *p, real *costs, real *after, int *found);

/* ---- scan_beams.c: what a scan's beams tell ------------------------------------------------- */

void kmpc_told_beams(int beams, const real *ranges, const real *along, const unsigned char *counts,
                     const real *mount, real least, real most, real own, unsigned char *hits,
                     unsigned char *clear, real *reach, real *ends);
void kmpc_averaged_ranges(int beams, const real *ranges, const unsigned char *hits, real step,
                          real noise, real half, real *averaged, real *deviations);

/* ---- scan_map.c: what a scan's beams show of a map ------------------------------------------- */

struct kmpc_cells {
    int height, width;
    int column, row;    /* of the first cell, in the world */
    real cell, clock;   /* side, and now */
    signed char *state; /* (height, width) < 0: unknown; 0: free; n: until n more rays have passed */
    float *seen;        /* (height, width) when last */
    float *extent;      /* (height, width, 4) box around the hits; null if nobody asks */
    float *taken;       /* (height, width) when it was hit that was free; null if nobody asks */
};

struct kmpc_rays {
    real low[2], high[2];    /* corners of the area that none has left */
    real origin[2], turn[2]; /* the scanner; cosine and sine of the directions' frame */
    const float *squares;    /* (KMPC_DIRECTIONS + 1) square of how far they passed */
    real distance;           /* up to which all cells are looked at, along each axis */
    int farther;             /* whether those farther away are, for what was hit there */
};

void kmpc_pass_rays(const struct kmpc_cells *c, const struct kmpc_rays *rays);
void kmpc_mark(const struct kmpc_cells *c, int count, const real *points, const real *errors,
               int level);
int kmpc_hit_boxes(const struct kmpc_cells *c, const int *window, real *low, real *high);
int kmpc_rectangles(int height, int width, const unsigned char *cells, int *open, int *found);

#endif
