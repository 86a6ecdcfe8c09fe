/* Which configurations are surely free of collisions: a sufficient test, many configurations at
 * once. Bodies are convex: an oriented box around each, whose frame hangs on a joint, and vertices
 * in that frame. Two bodies are apart if their spheres are, or if along the axes of one box the
 * other box, or the other's vertices, stay away. Loops over lanes, LANES configurations at once, are
 * plain; compilers vectorise, and WIDEST and INLINE are explained in compiled.py.
 */
#include <math.h>

#define STEPS 16 /* directions in which two bodies are looked at last */

typedef float lanes[LANES];

/* Rotation by rows, then position. */
typedef struct {
    lanes entry[12];
} pose;

typedef struct {
    int joints;
    const int *parent;      /* -1: the world */
    const float *placement; /* 12 per joint, in its parent, at value zero */
    const float *sine;      /* 9: what the sine of the value adds to the rotation */
    const float *versine;   /* 9: what one minus its cosine adds */
    const float *slide;     /* 3: what the value adds to the position */
    int loose;              /* joints after these whose poses each configuration says itself */
    int bodies;
    const int *joint;
    const float *frame; /* 12 per body, in its joint: of its oriented box */
    const float *half;  /* 3 */
    const int *start;   /* first vertex of a body, and of the one after it */
    const float *vertices;
    const float *radius; /* of the sphere about the frame's origin */
} scene;

static INLINE void joint_pose(const scene *s, int j, const pose *above, const lanes value,
                       const lanes sine, const lanes versine, pose *out)
{
    const float *p = s->placement + 12 * j;
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++) {
            int e = 3 * r + c;
            float fixed = p[e], by_sine = s->sine[9 * j + e], by_versine = s->versine[9 * j + e];
            for (int l = 0; l < LANES; l++)
                out->entry[e][l] = fixed + by_sine * sine[l] + by_versine * versine[l];
        }
    for (int r = 0; r < 3; r++) {
        float fixed = p[9 + r], slide = s->slide[3 * j + r];
        for (int l = 0; l < LANES; l++)
            out->entry[9 + r][l] = fixed + slide * value[l];
    }
    if (!above)
        return;
    pose local = *out;
    for (int r = 0; r < 3; r++) {
        const float *x = above->entry[3 * r], *y = above->entry[3 * r + 1];
        const float *z = above->entry[3 * r + 2], *t = above->entry[9 + r];
        for (int c = 0; c < 3; c++)
            for (int l = 0; l < LANES; l++)
                out->entry[3 * r + c][l] = x[l] * local.entry[c][l] +
                                           y[l] * local.entry[3 + c][l] +
                                           z[l] * local.entry[6 + c][l];
        for (int l = 0; l < LANES; l++)
            out->entry[9 + r][l] = x[l] * local.entry[9][l] + y[l] * local.entry[10][l] +
                                   z[l] * local.entry[11][l] + t[l];
    }
}

static INLINE void body_pose(const float *f, const pose *above, pose *out)
{
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 4; c++) {
            int e = c < 3 ? 3 * r + c : 9 + r;
            if (!above) {
                for (int l = 0; l < LANES; l++)
                    out->entry[e][l] = f[e];
                continue;
            }
            const float *x = above->entry[3 * r], *y = above->entry[3 * r + 1];
            const float *z = above->entry[3 * r + 2], *t = above->entry[9 + r];
            float a = c < 3 ? f[c] : f[9], b = c < 3 ? f[3 + c] : f[10];
            float d = c < 3 ? f[6 + c] : f[11], shift = c < 3 ? 0.0f : 1.0f;
            for (int l = 0; l < LANES; l++)
                out->entry[e][l] = x[l] * a + y[l] * b + z[l] * d + shift * t[l];
        }
}

/* near: 1 where the spheres of two bodies come closer than the padding. Returns whether any do. */
static INLINE int spheres_near(const pose *a, const pose *b, float reach, int *near)
{
    int any = 0;
    for (int l = 0; l < LANES; l++) {
        float x = b->entry[9][l] - a->entry[9][l], y = b->entry[10][l] - a->entry[10][l];
        float z = b->entry[11][l] - a->entry[11][l];
        near[l] = !(x * x + y * y + z * z > reach * reach);
        any |= near[l];
    }
    return any;
}

/* Pose of b in the frame of a. */
static INLINE void relative(const pose *a, const pose *b, pose *out)
{
    for (int r = 0; r < 3; r++) {
        const float *x = a->entry[r], *y = a->entry[3 + r], *z = a->entry[6 + r];
        for (int c = 0; c < 3; c++)
            for (int l = 0; l < LANES; l++)
                out->entry[3 * r + c][l] = x[l] * b->entry[c][l] + y[l] * b->entry[3 + c][l] +
                                           z[l] * b->entry[6 + c][l];
        for (int l = 0; l < LANES; l++)
            out->entry[9 + r][l] = x[l] * (b->entry[9][l] - a->entry[9][l]) +
                                   y[l] * (b->entry[10][l] - a->entry[10][l]) +
                                   z[l] * (b->entry[11][l] - a->entry[11][l]);
    }
}

/* Clear near where a box around the origin and an interval along its axes are apart, or, with a
 * negative padding, where they overlap by less than that along one axis. */
static INLINE void separate(lanes low[3], lanes high[3], const float *half, float padding, int *near)
{
    int may_overlap = padding < 0;
    for (int l = 0; l < LANES; l++) {
        float apart = 0, widest = -1e30f;
        for (int r = 0; r < 3; r++) {
            float above = low[r][l] - half[r], below = -half[r] - high[r][l];
            float gap = above > below ? above : below;
            widest = gap > widest ? gap : widest;
            gap = gap > 0 ? gap : 0;
            apart += gap * gap;
        }
        near[l] &= may_overlap ? !(widest > padding) : !(apart > padding * padding);
    }
}

static INLINE void boxes(const pose *b, const float *half_a, const float *half_b, float padding,
                  int *near)
{
    lanes low[3], high[3];
    for (int r = 0; r < 3; r++)
        for (int l = 0; l < LANES; l++) {
            float width = fabsf(b->entry[3 * r][l]) * half_b[0] +
                          fabsf(b->entry[3 * r + 1][l]) * half_b[1] +
                          fabsf(b->entry[3 * r + 2][l]) * half_b[2];
            low[r][l] = b->entry[9 + r][l] - width;
            high[r][l] = b->entry[9 + r][l] + width;
        }
    separate(low, high, half_a, padding, near);
}

static INLINE void vertices(const pose *b, const float *half_a, const float *points, int count,
                     float padding, int *near)
{
    lanes low[3], high[3];
    for (int r = 0; r < 3; r++) {
        const float *x = b->entry[3 * r], *y = b->entry[3 * r + 1];
        const float *z = b->entry[3 * r + 2], *t = b->entry[9 + r];
        lanes least, most;
        for (int l = 0; l < LANES; l++)
            least[l] = 1e30f, most[l] = -1e30f;
        for (int i = 0; i < count; i++) {
            float px = points[3 * i], py = points[3 * i + 1], pz = points[3 * i + 2];
            for (int l = 0; l < LANES; l++) {
                float at = x[l] * px + y[l] * py + z[l] * pz;
                least[l] = at < least[l] ? at : least[l];
                most[l] = at > most[l] ? at : most[l];
            }
        }
        for (int l = 0; l < LANES; l++) {
            low[r][l] = least[l] + t[l];
            high[r][l] = most[l] + t[l];
        }
    }
    separate(low, high, half_a, padding, near);
}

static INLINE int any_of(const int *near)
{
    int any = 0;
    for (int l = 0; l < LANES; l++)
        any |= near[l];
    return any;
}

/* near: 1 where two bodies may come closer than the padding. Returns whether any do. */
static INLINE int pair_near(const scene *s, const pose *poses, int a, int b, float padding, int *near)
{
    if (!spheres_near(&poses[a], &poses[b], s->radius[a] + s->radius[b] + padding, near))
        return 0;
    const float *half_a = s->half + 3 * a, *half_b = s->half + 3 * b;
    pose b_in_a, a_in_b;
    relative(&poses[a], &poses[b], &b_in_a);
    boxes(&b_in_a, half_a, half_b, padding, near);
    if (!any_of(near))
        return 0;
    relative(&poses[b], &poses[a], &a_in_b);
    boxes(&a_in_b, half_b, half_a, padding, near);
    if (!any_of(near))
        return 0;
    const int *start = s->start;
    vertices(&b_in_a, half_a, s->vertices + 3 * start[b], start[b + 1] - start[b], padding, near);
    if (!any_of(near))
        return 0;
    vertices(&a_in_b, half_b, s->vertices + 3 * start[a], start[a + 1] - start[a], padding, near);
    return any_of(near);
}

/* A position and a quaternion, x y z w, in one lane. */
static INLINE void loose_pose(const double *p, int l, pose *out)
{
    double x = p[3], y = p[4], z = p[5], w = p[6], s = 2 / (x * x + y * y + z * z + w * w);
    const float entry[12] = {
        1 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y),
        s * (x * y + w * z), 1 - s * (x * x + z * z), s * (y * z - w * x),
        s * (x * z - w * y), s * (y * z + w * x), 1 - s * (x * x + y * y),
        p[0], p[1], p[2]};
    for (int e = 0; e < 12; e++)
        out->entry[e][l] = entry[e];
}

/* Where all bodies are in the configurations from the first on; behind the last it stays. */
static INLINE void place(const scene *s, int first, int count, const float *value, const float *sine,
                         const float *versine, const double *loose, pose *joints, pose *poses)
{
    for (int k = 0; k < s->loose; k++)
        for (int l = 0; l < LANES; l++) {
            int row = first + l < count ? first + l : count - 1;
            loose_pose(loose + 7 * (row * s->loose + k), l, &joints[s->joints + k]);
        }
    for (int j = 0; j < s->joints; j++) {
        lanes v, sn, vs;
        for (int l = 0; l < LANES; l++) {
            int row = first + l < count ? first + l : count - 1;
            v[l] = value[row * s->joints + j];
            sn[l] = sine[row * s->joints + j];
            vs[l] = versine[row * s->joints + j];
        }
        joint_pose(s, j, s->parent[j] < 0 ? 0 : &joints[s->parent[j]], v, sn, vs, &joints[j]);
    }
    for (int i = 0; i < s->bodies; i++)
        body_pose(s->frame + 12 * i, s->joint[i] < 0 ? 0 : &joints[s->joint[i]], &poses[i]);
}

/* Values, sines and one minus cosines (count, joints) to near (count, pairs), which is zero before:
 * 1 unless it is sure that a pair of bodies is farther apart than its padding. */
WIDEST void certify(const scene *s, int pairs, const int *pair, const float *padding, int count,
             const float *value, const float *sine, const float *versine, unsigned char *near)
{
    pose joints[s->joints], poses[s->bodies];
    for (int first = 0; first < count; first += LANES) {
        place(s, first, count, value, sine, versine, 0, joints, poses);
        for (int p = 0; p < pairs; p++) {
            int unsure[LANES];
            if (!pair_near(s, poses, pair[2 * p], pair[2 * p + 1], padding[p], unsure))
                continue;
            for (int l = 0; l < LANES && first + l < count; l++)
                near[(long)(first + l) * pairs + p] = unsure[l];
        }
    }
}

static INLINE float dot(const float *a, const float *b)
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* The vertex of a body that lies farthest along a direction in its frame. */
static const float *farthest(const scene *s, int body, const float *direction)
{
    const float *found = s->vertices + 3 * s->start[body], *end = s->vertices + 3 * s->start[body + 1];
    float most = dot(found, direction);
    for (const float *v = found + 3; v < end; v += 3) {
        float along = dot(v, direction);
        if (along > most)
            most = along, found = v;
    }
    return found;
}

/* Whether along some direction the vertices of two bodies are farther apart than the padding.
 * The directions go to the point of their difference that is nearest to its origin: each step to
 * the nearest one on the way to what lies farthest against the last direction. */
static int split(const scene *s, const pose *poses, int a, int b, int lane, float padding)
{
    pose relation;
    relative(&poses[a], &poses[b], &relation);
    float turn[9], shift[3];
    for (int e = 0; e < 9; e++)
        turn[e] = relation.entry[e][lane];
    for (int r = 0; r < 3; r++)
        shift[r] = relation.entry[9 + r][lane];
    float to[3] = {shift[0], shift[1], shift[2]};
    for (int step = 0; step < STEPS; step++) {
        float back[3];
        for (int c = 0; c < 3; c++)
            back[c] = -(turn[c] * to[0] + turn[3 + c] * to[1] + turn[6 + c] * to[2]);
        const float *of_a = farthest(s, a, to), *of_b = farthest(s, b, back);
        float between[3], way[3];
        for (int r = 0; r < 3; r++)
            between[r] = dot(turn + 3 * r, of_b) + shift[r] - of_a[r];
        if (dot(between, to) > padding * sqrtf(dot(to, to)))
            return 1;
        for (int r = 0; r < 3; r++)
            way[r] = between[r] - to[r];
        float part = step ? -dot(to, way) / dot(way, way) : 1;
        part = part < 1 ? part : 1;
        if (!(part > 0))
            return 0;
        for (int r = 0; r < 3; r++)
            to[r] += part * way[r];
    }
    return 0;
}

/* Values (count, joints) in columns, poses (count, loose, 7), and which pairs (count, pairs) are not
 * looked at, to sure (count): whether all is finite and the others are farther apart than their
 * paddings. */
WIDEST void settle(const scene *s, int pairs, const int *pair, const float *padding, int count,
            const int *column, const double *values, const double *loose,
            const unsigned char *skip, unsigned char *sure)
{
    float value[count * s->joints], sine[count * s->joints], versine[count * s->joints];
    for (int row = 0, i = 0; row < count; row++) {
        double total = 0;
        for (int k = 0; k < 7 * s->loose; k++)
            total += loose[7 * row * s->loose + k];
        for (int j = 0; j < s->joints; j++, i++) {
            total += value[i] = values[row * s->joints + column[j]];
            sine[i] = sinf(value[i]);
            versine[i] = 1 - cosf(value[i]);
        }
        sure[row] = isfinite(total) != 0;
    }
    pose joints[s->joints + s->loose], poses[s->bodies];
    for (int first = 0; first < count; first += LANES) {
        int rows = count - first < LANES ? count - first : LANES, unsure[LANES];
        place(s, first, count, value, sine, versine, loose, joints, poses);
        for (int p = 0; p < pairs; p++) {
            int a = pair[2 * p], b = pair[2 * p + 1], wanted = 0;
            for (int l = 0; l < rows; l++)
                wanted |= sure[first + l] && !skip[(first + l) * pairs + p];
            if (!wanted || !pair_near(s, poses, a, b, padding[p], unsure))
                continue;
            for (int l = 0; l < rows; l++)
                if (unsure[l] && sure[first + l] && !skip[(first + l) * pairs + p])
                    sure[first + l] = split(s, poses, a, b, l, padding[p]);
        }
    }
}

/* Raise least to the distance of a box around the origin and one at a pose, where they are apart. */
static INLINE void box_gap(const pose *b, const float *half_a, const float *half_b, lanes least)
{
    lanes apart = {0};
    for (int r = 0; r < 3; r++)
        for (int l = 0; l < LANES; l++) {
            float width = fabsf(b->entry[3 * r][l]) * half_b[0] +
                          fabsf(b->entry[3 * r + 1][l]) * half_b[1] +
                          fabsf(b->entry[3 * r + 2][l]) * half_b[2];
            float gap = fabsf(b->entry[9 + r][l]) - width - half_a[r];
            gap = gap > 0 ? gap : 0;
            apart[l] += gap * gap;
        }
    for (int l = 0; l < LANES; l++) {
        float gap = sqrtf(apart[l]);
        least[l] = gap > 0 && gap > least[l] ? gap : least[l];
    }
}

/* The same to least (count, pairs): what the distance of a pair of bodies is at least. */
WIDEST void gaps(const scene *s, int pairs, const int *pair, int count, const float *value,
          const float *sine, const float *versine, float *least)
{
    pose joints[s->joints], poses[s->bodies];
    for (int first = 0; first < count; first += LANES) {
        place(s, first, count, value, sine, versine, 0, joints, poses);
        for (int p = 0; p < pairs; p++) {
            int a = pair[2 * p], b = pair[2 * p + 1];
            pose b_in_a, a_in_b;
            relative(&poses[a], &poses[b], &b_in_a);
            relative(&poses[b], &poses[a], &a_in_b);
            lanes gap;
            for (int l = 0; l < LANES; l++) {
                float x = b_in_a.entry[9][l], y = b_in_a.entry[10][l], z = b_in_a.entry[11][l];
                gap[l] = sqrtf(x * x + y * y + z * z) - s->radius[a] - s->radius[b];
            }
            box_gap(&b_in_a, s->half + 3 * a, s->half + 3 * b, gap);
            box_gap(&a_in_b, s->half + 3 * b, s->half + 3 * a, gap);
            for (int l = 0; l < LANES && first + l < count; l++)
                least[(long)(first + l) * pairs + p] = gap[l];
        }
    }
}
