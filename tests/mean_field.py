"""The rate of a balanced network from itself, for the tests and the page of `balanced_network`."""

from __future__ import annotations

import math

from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.special import erfcx

ZETA_HALF = -1.4603545088095868  # Riemann's zeta function at 1/2


def siegert_rate(mu_mv, sigma_mv, *, tau, tau_s, refractory, threshold_mv, reset_mv):
    """Rate of a leaky integrate-and-fire neuron with a noisy input, [1/s] (Siegert 1951, Brunel 2000 eq. 21).

    nu = 1 / (t_ref + tau sqrt(pi) int_{(V_r - mu) / sigma}^{(V_th - mu) / sigma} exp(u^2) (1 + erf u) du).
    Synapses of time constant tau_s shift both bounds by sqrt(2) |zeta(1/2)| / 2 sqrt(tau_s / tau)
    (Fourcaud and Brunel 2002). Potentials are from rest.
    """
    shift = math.sqrt(2) * abs(ZETA_HALF) / 2 * math.sqrt(tau_s / tau)
    low, high = ((v - mu_mv) / sigma_mv + shift for v in (reset_mv, threshold_mv))
    integral, _ = quad(lambda u: erfcx(-u), low, high, limit=200)
    return 1 / (refractory + tau * math.sqrt(math.pi) * integral)


def self_consistent(
    *,
    excitatory=40,
    inhibitory=10,
    weight_mv=8.0,
    balance=8.0,
    drive_mv=30.0,
    tau=0.02,
    tau_s=0.002,
    dt=0.0005,
):
    """Rate [1/s], mean and deviation of the input [mV] at which the network's rate is that of its neurons.

    A spike adds weight tau_s / tau to the potential; in steps of dt a current lasts
    dt / (1 - exp(-dt / tau_s)) instead of tau_s.
    """
    charge = weight_mv * dt / (1 - math.exp(-dt / tau_s)) / tau

    def moments(rate):
        mu = drive_mv + tau * charge * (excitatory - balance * inhibitory) * rate
        return mu, charge * math.sqrt(tau * (excitatory + balance**2 * inhibitory) * rate)

    def excess(rate):
        neuron = {"tau": tau, "tau_s": tau_s, "refractory": 0.002, "threshold_mv": 20.0, "reset_mv": 10.0}
        return siegert_rate(*moments(rate), **neuron) - rate

    rate = brentq(excess, 1, 100)
    return rate, *moments(rate)
