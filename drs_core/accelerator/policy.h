/* What the policy sees and does: time feature, frozen normalisation, multi-layer perceptron.
 *
 * Features are those of the Python path bit for bit. The network adds up in another order than numpy, so
 * actions differ in their last bits: an input at a time, over all outputs of a layer, which gives the same
 * bits however wide the processor's vectors are, and leaves out inputs that are 0 (half of them after ReLU).
 */
#ifndef DRS_POLICY_H
#define DRS_POLICY_H

#include <math.h>
#include <stdint.h>

enum activation { TANH, RELU, ELU, LEAKY_RELU, SILU, ACTIVATIONS };
enum { MAX_LAYERS = 64, MAX_UNITS = 65536 };

typedef struct {
    int32_t n_features, time_index, time_limit; /* time_index -1: no time feature */
    int32_t n_layers, activation, squashed;     /* squashed: tanh, then scaled to the bounds; else clipped */
    double mean_clip;                           /* 0: none */
    const double *mean, *scale, *clip;          /* (n_features,) */
    const int32_t *sizes;                       /* (n_layers + 1,) */
    const float *parameters;                    /* layer by layer: weight transposed (inputs, outputs), bias */
    const double *low, *high;                   /* (n_actions,) */
    double *scratch;                            /* twice the widest layer */
} policy_t;

static double clipped(double x, double low, double high) { return x < low ? low : x > high ? high : x; }

static void features_of(const policy_t *p, const float *observation, int step, float *features) {
    for (int i = 0; i < p->n_features; i++) {
        double x = i == p->time_index ? (float)(1.0 - (double)step / p->time_limit) : observation[i];
        features[i] = (float)clipped((x - p->mean[i]) / p->scale[i], -p->clip[i], p->clip[i]);
    }
}

/* The only code with wider vectors than SSE2, where the processor has them: the compiler clears the state that
 * they leave, which would slow Bullet down. Outputs lie side by side in a vector, so the bits are the same. */
#define WIDE __attribute__((target_clones("avx2", "default")))

WIDE static void layer(const float *restrict weight, const float *restrict bias, const double *restrict x,
                       int inputs, double *restrict out, int outputs) {
    for (int i = 0; i < outputs; i++) out[i] = bias[i];
    for (int j = 0; j < inputs;) {
        const float *row[4];
        double value[4];
        int found = 0;
        /* four inputs at a time: fewer passes over `out`, the same order of additions */
        for (; j < inputs && found < 4; j++) {
            if (x[j] == 0.0) continue;
            row[found] = weight + (size_t)j * outputs;
            value[found++] = x[j];
        }
        if (found == 4) {
            const float *restrict a = row[0], *restrict b = row[1], *restrict c = row[2], *restrict d = row[3];
            const double u = value[0], v = value[1], w = value[2], y = value[3];
            for (int i = 0; i < outputs; i++) out[i] = (((out[i] + a[i] * u) + b[i] * v) + c[i] * w) + d[i] * y;
        } else {
            for (int k = 0; k < found; k++)
                for (int i = 0; i < outputs; i++) out[i] += row[k][i] * value[k];
        }
    }
}

static void activate(int kind, double *x, int n) {
    switch (kind) {
        case TANH:
            for (int i = 0; i < n; i++) x[i] = tanh(x[i]);
            break;
        case RELU: /* NaN stays NaN, here and below, as in numpy */
            for (int i = 0; i < n; i++) x[i] = x[i] < 0.0 ? 0.0 : x[i];
            break;
        case ELU:
            for (int i = 0; i < n; i++) x[i] = x[i] < 0.0 ? expm1(x[i]) : x[i];
            break;
        case LEAKY_RELU:
            for (int i = 0; i < n; i++) x[i] = x[i] < 0.0 ? 0.01 * x[i] : x[i];
            break;
        default:
            for (int i = 0; i < n; i++) x[i] = x[i] / (1.0 + exp(-(x[i] < -700.0 ? -700.0 : x[i])));
    }
}

/* features (n_features,) -> action (n_actions,) */
static void act(const policy_t *p, const float *features, float *action) {
    int widest = 0;
    for (int l = 0; l <= p->n_layers; l++) widest = p->sizes[l] > widest ? p->sizes[l] : widest;
    double *in = p->scratch, *out = p->scratch + widest;
    const float *parameters = p->parameters;
    for (int i = 0; i < p->n_features; i++) in[i] = features[i];
    for (int l = 0; l < p->n_layers; l++) {
        const int inputs = p->sizes[l], outputs = p->sizes[l + 1];
        const float *bias = parameters + (size_t)inputs * outputs;
        layer(parameters, bias, in, inputs, out, outputs);
        if (l < p->n_layers - 1) activate(p->activation, out, outputs);
        parameters = bias + outputs;
        double *swap = in;
        in = out, out = swap;
    }
    for (int i = 0; i < p->sizes[p->n_layers]; i++) {
        double x = in[i];
        if (p->squashed) {
            if (p->mean_clip > 0.0) x = clipped(x, -p->mean_clip, p->mean_clip);
            x = (tanh(x) + 1.0) * (0.5 * (p->high[i] - p->low[i])) + p->low[i];
        } else {
            x = clipped(x, p->low[i], p->high[i]);
        }
        action[i] = (float)x;
    }
}

static int policy_is_sound(const policy_t *p, int n_observation, int n_actions) {
    if (p->n_layers < 1 || p->n_layers > MAX_LAYERS || p->activation < 0 || p->activation >= ACTIVATIONS) return 0;
    for (int l = 0; l <= p->n_layers; l++)
        if (p->sizes[l] < 1 || p->sizes[l] > MAX_UNITS) return 0;
    const int timed = p->time_index >= 0;
    return p->sizes[0] == p->n_features && p->sizes[p->n_layers] == n_actions &&
           p->n_features == n_observation + timed && (!timed || (p->time_index == n_observation && p->time_limit > 0));
}

#endif
