/* The few functions of Bullet's C interface that a step needs.
 *
 * PyBullet's wheel has no headers but exports the functions, so they are declared here and looked up in
 * the library that is loaded already. That Bullet and these declarations agree is checked twice: Bullet
 * compares its magic number when it loads the helper, and Python runs an episode through both paths.
 */
#ifndef DRS_BULLET_H
#define DRS_BULLET_H

#include <dlfcn.h>
#include <stddef.h>
#include <string.h>

enum { BULLET_MAGIC_NUMBER = 202010061, CONTROL_MODE_TORQUE = 1 };

typedef void *client_t;  /* the helper's own client of the server that PyBullet's client has */
typedef void *command_t;
typedef void *status_t;

typedef struct {
    int flags, body_a, body_b, link_a, link_b;
    double rest[19]; /* positions, normal, distance, forces */
} contact_t;

typedef struct {
    int count;
    contact_t *points;
} contacts_t;

_Static_assert(sizeof(contact_t) == 176 && sizeof(contacts_t) == 16, "Bullet's structures on x86-64");

static struct {
    command_t (*step)(client_t);
    command_t (*joint_control)(client_t, int body, int mode);
    void (*torque)(command_t, int dof, double newton_metres);
    command_t (*state)(client_t, int body);
    int (*with_velocities)(command_t, int on);
    int (*read_state)(status_t, int *body, int *links, int *q_size, int *u_size, const double **root_frame,
                      const double **q, const double **u, const double **reactions, const double **link_frames,
                      const double **motor_torques, const double **link_poses, const double **link_velocities);
    command_t (*contacts)(client_t);
    void (*of_body_a)(command_t, int body);
    void (*of_body_b)(command_t, int body);
    void (*read_contacts)(client_t, contacts_t *);
    status_t (*submit)(client_t, command_t);
} bullet;

/* Looks every function up in PyBullet's library at this path; 0, or -1 where one is missing. */
static int bullet_bind(const char *path) {
    const struct {
        void *slot;
        const char *name;
    } wanted[] = {
        {&bullet.step, "b3InitStepSimulationCommand"},
        {&bullet.joint_control, "b3JointControlCommandInit2"},
        {&bullet.torque, "b3JointControlSetDesiredForceTorque"},
        {&bullet.state, "b3RequestActualStateCommandInit"},
        {&bullet.with_velocities, "b3RequestActualStateCommandComputeLinkVelocity"},
        {&bullet.read_state, "b3GetStatusActualState2"},
        {&bullet.contacts, "b3InitRequestContactPointInformation"},
        {&bullet.of_body_a, "b3SetContactFilterBodyA"},
        {&bullet.of_body_b, "b3SetContactFilterBodyB"},
        {&bullet.read_contacts, "b3GetContactPointInformation"},
        {&bullet.submit, "b3SubmitClientCommandAndWaitStatus"},
    };
    void *library = dlopen(path, RTLD_NOW | RTLD_NOLOAD);
    if (!library) return -1;
    for (size_t i = 0; i < sizeof wanted / sizeof *wanted; i++) {
        void *function = dlsym(library, wanted[i].name);
        if (!function) return -1;
        memcpy(wanted[i].slot, &function, sizeof function);
    }
    return 0;
}

#endif
