/* A whole episode of a PyBullet locomotion robot in one call.
 *
 * Python makes the world and resets it. PyBullet then loads this file as a plugin, which hands over a
 * client of the same server, and drs_rollout does what a step of pybullet_envs_gymnasium does with half a
 * dozen commands: torques, step, state, contacts; then observation, reward and ending. Everything is
 * computed in the order and precision of the original (float64 there, float32 where numpy has float32), so
 * that the same actions give the same bits. One thread only: Bullet's clients share their server.
 */
#include "bullet.h"
#include "policy.h"

enum { MAX_JOINTS = 32, MAX_PARTS = 128, MAX_FEET = 16, BODY_FEATURES = 8 };
enum result { DONE = 0, WRONG_SIZES = -1, BULLET_REFUSED = -2, NOT_FINITE_ACTION = -3 };

/* The robot, as PyBullet and the original describe it. */
typedef struct {
    int32_t body, floor_body, torso_link; /* torso_link -1: the base */
    int32_t n_joints, n_parts, n_feet;
    int32_t n_bruising, falls;                        /* feet whose contact is no good; whether a fall ends it */
    int32_t fused;                                    /* whether numpy's dot rounds once, as on AVX-512 machines */
    const int32_t *joint_q, *joint_u;                 /* (n_joints,) place of a joint in q and u */
    const int32_t *part_link, *foot_link, *bruising;  /* link -1: the base, -2: stands at `fixed` */
    const double *joint_low, *joint_high, *joint_gain; /* rad, rad, N m for an action of 1 */
    const double *fixed;                              /* (n_parts, 2) x, y of parts that never move [m] */
    double least_height, greatest_pitch;              /* alive above and below [m, rad]; 0: not looked at */
    double target_x, target_y, dt;                    /* m, m, s of a step */
    double electricity_cost, stall_torque_cost, limit_cost;
} robot_t;

/* What goes in and comes out. `actions` is an input where there is no policy. */
typedef struct {
    int32_t capacity, length, terminated;
    float *observations; /* (capacity + 1, n_observation): one more, after the last step */
    float *features;     /* (capacity, n_features), with a policy */
    float *actions;      /* (capacity, n_actions) */
    double *rewards;     /* (capacity,) */
    double total;        /* of the rewards, added in their order */
} record_t;

/* What one step leaves to the next. */
typedef struct {
    double initial_z, height, pitch, distance;
    float speeds[MAX_JOINTS], touching[MAX_FEET];
    int at_limit;
} moment_t;

static client_t newest_client;

int initPlugin_drs(const void *context) {
    memcpy(&newest_client, context, sizeof newest_client); /* the context's first field */
    return BULLET_MAGIC_NUMBER;
}

void exitPlugin_drs(void *context) { (void)context; }

int executePluginCommand_drs(void *context, const void *arguments) {
    (void)context, (void)arguments;
    return -1;
}

/* The client that the latest loadPlugin made, once; NULL where it made none. */
client_t drs_take_client(void) {
    client_t client = newest_client;
    newest_client = NULL;
    return client;
}

int drs_bind(const char *pybullet) { return bullet_bind(pybullet); }

const char *drs_source_digest(void) { return DRS_SOURCE_DIGEST; }

/* Sum of n numbers, each `stride` apart, in the order of numpy's pairwise summation (n <= 128). */
#define NUMPY_SUM(name, real)                                                                                   \
    static real name(const real *x, int n, int stride) {                                                        \
        real sum = 0, r[8];                                                                                     \
        int i = 0;                                                                                              \
        if (n >= 8) {                                                                                           \
            for (; i < 8; i++) r[i] = x[i * stride];                                                            \
            for (; i + 8 <= n; i += 8)                                                                          \
                for (int k = 0; k < 8; k++) r[k] += x[(i + k) * stride];                                        \
            sum = ((r[0] + r[1]) + (r[2] + r[3])) + ((r[4] + r[5]) + (r[6] + r[7]));                            \
        }                                                                                                       \
        for (; i < n; i++) sum += x[i * stride];                                                                \
        return sum;                                                                                             \
    }
NUMPY_SUM(sum_of_doubles, double)
NUMPY_SUM(sum_of_floats, float)

/* Roll, pitch and yaw of the quaternion (x, y, z, w), as PyBullet's getEulerFromQuaternion. */
static void euler(const double *q, double *roll, double *pitch, double *yaw) {
    const double x = q[0], y = q[1], z = q[2], w = q[3];
    const double sine = -2 * (x * z - w * y);
    if (sine <= -0.99999 || sine >= 0.99999) { /* straight up or down: only the sum of roll and yaw is known */
        const double sign = sine < 0 ? 1 : -1;
        *roll = 0, *pitch = -sign * 0.5 * 3.14159265358979323846, *yaw = 2 * atan2(sign * x, -sign * y);
    } else {
        *roll = atan2(2 * (y * z + w * x), w * w - x * x - y * y + z * z);
        *pitch = asin(sine);
        *yaw = atan2(2 * (x * y + w * z), w * w + x * x - y * y - z * z);
    }
}

static float within_five(float x) { return x < -5.0f ? -5.0f : x > 5.0f ? 5.0f : x; }

/* Reads the world's state; observation (BODY_FEATURES + 2 n_joints + n_feet,). */
static int observe(client_t client, const robot_t *r, moment_t *now, int first, float *observation) {
    const double *root, *q, *u, *reactions, *frames, *torques, *poses, *velocities;
    int body, links, q_size, u_size;
    command_t command = bullet.state(client, r->body);
    if (r->torso_link >= 0) bullet.with_velocities(command, 1);
    if (!bullet.read_state(bullet.submit(client, command), &body, &links, &q_size, &u_size, &root, &q, &u, &reactions,
                           &frames, &torques, &poses, &velocities))
        return BULLET_REFUSED;
    if (r->torso_link >= links || q_size < 7 || u_size < 6) return WRONG_SIZES;

    float *j = observation + BODY_FEATURES;
    now->at_limit = 0;
    for (int i = 0; i < r->n_joints; i++) {
        if (r->joint_q[i] >= q_size || r->joint_u[i] >= u_size) return WRONG_SIZES;
        const double low = r->joint_low[i], high = r->joint_high[i];
        j[2 * i] = (float)(2 * (q[r->joint_q[i]] - low) / (high - low) - 1.0);
        j[2 * i + 1] = now->speeds[i] = (float)(0.1 * u[r->joint_u[i]]);
        now->at_limit += fabsf(j[2 * i]) > 0.99f;
    }

    double xy[2 * MAX_PARTS];
    for (int i = 0; i < r->n_parts; i++) {
        const int link = r->part_link[i];
        if (link >= links) return WRONG_SIZES;
        const double *position = link == -2 ? r->fixed + 2 * i : link == -1 ? q : poses + 7 * link;
        xy[2 * i] = position[0], xy[2 * i + 1] = position[1];
    }
    const double *torso = r->torso_link < 0 ? q : poses + 7 * r->torso_link;
    const double *speed = r->torso_link < 0 ? u : velocities + 6 * r->torso_link;
    const double dx = r->target_x - sum_of_doubles(xy, r->n_parts, 2) / r->n_parts;
    const double dy = r->target_y - sum_of_doubles(xy + 1, r->n_parts, 2) / r->n_parts;
    double roll, yaw;
    euler(torso + 3, &roll, &now->pitch, &yaw);
    if (first) now->initial_z = torso[2];
    now->distance = sqrt(r->fused ? fma(dx, dx, dy * dy) : dy * dy + dx * dx);
    const double angle = atan2(dy, dx) - yaw, c = cos(-yaw), s = sin(-yaw);

    observation[0] = (float)(torso[2] - now->initial_z);
    observation[1] = (float)sin(angle);
    observation[2] = (float)cos(angle);
    /* a product of matrices in the original: its zeros decide the sign of a zero, and what an infinity becomes.
     * Where BLAS rounds it otherwise, float32 hides the last of its 53 bits. */
    observation[3] = (float)(0.3 * (c * speed[0] + -s * speed[1] + 0.0 * speed[2]));
    observation[4] = (float)(0.3 * (s * speed[0] + c * speed[1] + 0.0 * speed[2]));
    observation[5] = (float)(0.3 * (0.0 * speed[0] + 0.0 * speed[1] + speed[2]));
    observation[6] = (float)roll;
    observation[7] = (float)now->pitch;
    memcpy(j + 2 * r->n_joints, now->touching, r->n_feet * sizeof(float)); /* of the step before, as upstream */
    for (int i = 0; i < BODY_FEATURES + 2 * r->n_joints + r->n_feet; i++) observation[i] = within_five(observation[i]);
    now->height = observation[0] + now->initial_z;
    return DONE;
}

static void feel_the_floor(client_t client, const robot_t *r, moment_t *now) {
    command_t command = bullet.contacts(client);
    contacts_t contacts = {0, NULL};
    bullet.of_body_a(command, r->body);
    bullet.of_body_b(command, r->floor_body);
    bullet.submit(client, command);
    bullet.read_contacts(client, &contacts);
    for (int i = 0; i < r->n_feet; i++) {
        now->touching[i] = 0.0f;
        for (int k = 0; k < contacts.count && now->touching[i] == 0.0f; k++)
            now->touching[i] = contacts.points[k].link_a == r->foot_link[i] && contacts.points[k].link_b == -1;
    }
}

static int is_alive(const robot_t *r, const moment_t *now) {
    int alive = (r->least_height == 0 || now->height > r->least_height) &&
                (r->greatest_pitch == 0 || fabs(now->pitch) < r->greatest_pitch);
    for (int i = 0; i < r->n_bruising; i++) alive = alive && now->touching[r->bruising[i]] == 0.0f;
    return alive;
}

static double effort(const robot_t *r, const moment_t *now, const float *action) {
    float power[MAX_JOINTS], squares[MAX_JOINTS];
    for (int i = 0; i < r->n_joints; i++) {
        power[i] = fabsf(action[i] * now->speeds[i]);
        squares[i] = action[i] * action[i];
    }
    const double electricity = r->electricity_cost * (double)(sum_of_floats(power, r->n_joints, 1) / (float)r->n_joints);
    return electricity + r->stall_torque_cost * (double)(sum_of_floats(squares, r->n_joints, 1) / (float)r->n_joints);
}

/* One step with `action`; the observation after it, its reward, and whether it ended the episode. */
static int step(client_t client, const robot_t *r, const float *action, moment_t *now, float *observation,
                double *reward, int *ended) {
    command_t command = bullet.joint_control(client, r->body, CONTROL_MODE_TORQUE);
    for (int i = 0; i < r->n_joints; i++) {
        if (!isfinite(action[i])) return NOT_FINITE_ACTION;
        bullet.torque(command, r->joint_u[i], r->joint_gain[i] * (double)(float)clipped(action[i], -1.0, 1.0));
    }
    bullet.submit(client, command);
    bullet.submit(client, bullet.step(client));

    const double potential = -now->distance / r->dt;
    const int result = observe(client, r, now, 0, observation);
    if (result != DONE) return result;
    const int alive = is_alive(r, now); /* before the contacts of this step are known, as upstream */
    *ended = r->falls && !alive;
    for (int i = 0; i < BODY_FEATURES + 2 * r->n_joints + r->n_feet; i++) *ended |= !isfinite(observation[i]);
    feel_the_floor(client, r, now);
    const double progress = -now->distance / r->dt - potential;
    *reward = (((alive ? 1.0 : -1.0) + progress) + effort(r, now, action)) + r->limit_cost * now->at_limit;
    return DONE;
}

static int links_are_sound(const int32_t *links, int n, int least) {
    for (int i = 0; i < n; i++)
        if (links[i] < least) return 0;
    return 1;
}

static int robot_is_sound(const robot_t *r) {
    if (r->n_joints < 1 || r->n_joints > MAX_JOINTS || r->n_parts < 1 || r->n_parts > MAX_PARTS || r->n_feet < 0 ||
        r->n_feet > MAX_FEET || r->n_bruising < 0 || r->n_bruising > r->n_feet)
        return 0;
    for (int i = 0; i < r->n_bruising; i++)
        if (r->bruising[i] < 0 || r->bruising[i] >= r->n_feet) return 0;
    return links_are_sound(r->joint_q, r->n_joints, 0) && links_are_sound(r->joint_u, r->n_joints, 0) &&
           links_are_sound(r->part_link, r->n_parts, -2) && links_are_sound(r->foot_link, r->n_feet, -1) &&
           r->torso_link >= -1;
}

/* The episode that begins in the world's present state: until it ends or `capacity` steps are taken, with the
 * policy's actions, or without one with those recorded. DONE, or another `result`. */
int drs_rollout(client_t client, const robot_t *robot, const policy_t *policy, record_t *record) {
    const int n_actions = robot->n_joints;
    if (!client || !bullet.submit || record->capacity < 1 || !robot_is_sound(robot)) return WRONG_SIZES;
    const int n_observation = BODY_FEATURES + 2 * n_actions + robot->n_feet;
    if (policy && !policy_is_sound(policy, n_observation, n_actions)) return WRONG_SIZES;

    moment_t now = {0};
    record->length = record->terminated = 0;
    record->total = 0.0;
    int result = observe(client, robot, &now, 1, record->observations);
    while (result == DONE && record->length < record->capacity && !record->terminated) {
        const size_t t = record->length;
        float *observation = record->observations + t * n_observation, *action = record->actions + t * n_actions;
        if (policy) {
            float *features = record->features + t * policy->n_features;
            features_of(policy, observation, (int)t, features);
            act(policy, features, action);
        }
        result = step(client, robot, action, &now, observation + n_observation, record->rewards + t,
                      &record->terminated);
        if (result == DONE) record->total += record->rewards[t], record->length++;
    }
    return result;
}
