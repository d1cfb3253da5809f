// Noise that a camera cuts off at 0: light t (in standard deviations of the noise n) is recorded as max(0, t
// + n), in the mean
//
//   g(t) = t Phi(t) + phi(t)
//
// and a sample that came out as 0 was on average t - lambda(t), lambda(t) = phi(t) / Phi(-t).
#pragma once

namespace glasswing {

// lambda(t) - t: how far below 0, in standard deviations, a sample was on average, if the recorded mean of
// its neighbours is g. From 0.80 where there is no light (g <= 0.40) down to 0.
float expected_below_zero(float g);

// E(n | t + n < 0) = -lambda(t).
double mean_noise_below(double t);

// The noise's sd over the sd of the remaining noise if a share of samples is 0, for light 0 to 3.
float sd_before_clipping(float zeros);

}  // namespace glasswing
