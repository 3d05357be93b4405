"""What is known of each closure coefficient: its symbol, where the paper states it, and a note."""

from __future__ import annotations

ABOUT = {
    "triboconductivity": ("lambda_1.1", "(2.25)", ""),
    "dispersion": ("lambda_1.2", "(2.26)", ""),
    "collisional_flux": ("lambda_1.3", "(2.27)", "(2.27) prints 5.936, 3/2 of the exact value."),
    "covariance_production_field": (
        "lambda_2.1",
        "(3.4), (5.3), (7.4)",
        "(3.4) prints 0.5422, a quarter of the exact value, which equals lambda_1.3/lambda_1.1.",
    ),
    "covariance_production_gradient": (
        "lambda_2.2",
        "(3.4), (5.3), (7.4)",
        "(3.4) prints 0.5422, a quarter of the exact value, which equals lambda_1.3/lambda_1.2.",
    ),
    "charge_exchange": ("lambda_2.3", "(3.6)", ""),
    "covariance_collision": ("C rate, 1/tau_c", "(3.4), (5.3), (7.2)", ""),
    "covariance_exchange": (
        "C rate, 1/tau_xi",
        "(3.4), (5.3), (7.2)",
        "(3.4) prints (3-e)/5, which is always positive; the exact rate is negative for nearly "
        "elastic particles, because fast collisions pass over more charge.",
    ),
    "third_moment_collision": (
        "K1, 1/tau_c",
        "(3.8), (A13)",
        "lambda_2.4 and lambda_2.5 print 7.3 to 8.4 times the exact rate. (A10), from which it "
        "follows, lacks a factor 1/2.",
    ),
    "third_moment_exchange": (
        "K1, 1/tau_xi",
        "(3.8), (A13)",
        "lambda_2.6 prints 3.201; the exact rate is that of the covariance, without a trace part.",
    ),
    "third_moment_drag": (
        "K1, 1/tau_p",
        "(3.8), (A1), (A13)",
        "Drag acts on both velocities: (A1) has 2/tau_p, (3.8) and (A13) print 1/tau_p.",
    ),
    "third_moment_trace": (
        "K2, 1/tau_c",
        "(3.9), (A14)",
        "lambda_2.7 and lambda_2.8 are not proportional to the exact rate. The trace runs over "
        "three directions in (A16), over one in (5.3).",
    ),
    "third_moment_shear": (
        "rho_1",
        "(3.10), (A11), (A15)",
        "lambda_2.9 and lambda_2.11. Its factor is d/L by (3.10), L/d in (5.3). The terms with "
        "R_p,jk in D_ij are negative in (3.10), which is right, and positive in (A15).",
    ),
    "third_moment_divergence": (
        "rho_2",
        "(3.10), (A11), (A15)",
        "lambda_2.10 and lambda_2.11; the exact rho_2 equals rho_1 for every e.",
    ),
    "variance_regain": (
        "lambda_3.1",
        "(4.2), (5.4), (7.6)",
        "(4.2) prints 21.29, a quarter of the exact value, which equals 6 lambda_3.2. (5.4) calls "
        "it lambda_7.",
    ),
    "variance_production_field": (
        "lambda_3.2",
        "(4.2), (5.4), (7.7)",
        "(5.4) calls it lambda_8 and prints tau_sigma without its star.",
    ),
    "variance_dispersion": (
        "lambda_3.3",
        "(4.2), (5.4)",
        "(4.2) prints 0.6278; the exact value equals lambda_3.1/12. (5.4) calls it lambda_9.",
    ),
    "variance_flux_exchange": (
        "lambda_3.4",
        "(4.3), (5.4), (B2), (B3)",
        "(4.3) prints 2.806, (5.4) 2.8. The right-hand side of (4.3) is negative, which is right, "
        "that of (B3) positive.",
    ),
    "variance_flux_regain": ("lambda_3.5", "(4.3), (B2), (B3)", "(4.3) prints 1.017."),
    "variance_flux_product": (
        "lambda_3.5 kappa",
        "(5.4)",
        "(5.4) prints 20.39, where lambda_3.5 = 1.017 of (4.3) gives 1.017 kappa = 3.95: the SI "
        "and the dimensionless equations differ.",
    ),
    "exchange_time": ("lambda'", "(5.20)", "(5.20) prints 12; (2.26) and (3.6) give its inverse."),
    "collisional_flux_number": (
        "lambda''",
        "(5.21)",
        "(5.21) prints 3.256, 3/2 of the exact value; the printed lambda_1.3/lambda_1.2 is 3.253.",
    ),
    "transferred_fraction": (
        "kappa",
        "(2.26), (3.5)",
        "Not printed. It gives gamma Theta^(a/2) from tau_c, L/d and Pe by (2.26) and (3.5).",
    ),
    "charge_third_moment": (
        "chi_1",
        "(2.24)",
        "Dropped by the paper: C(xi) answers to second derivatives of <xi'c'c'> with the "
        "dispersion D times this.",
    ),
    "covariance_third_moment": (
        "chi_2",
        "(3.4)",
        "Dropped by the paper: C(xi c) answers to the gradient of <xi'c'c'> with minus the "
        "collisional flux (2.27) times this.",
    ),
    "covariance_collisional_dispersion": (
        "chi_3",
        "(3.4)",
        "Dropped by the paper: collisions disperse the covariance with D times this.",
    ),
    "third_moment_flux": (
        "chi_4",
        "(A11)",
        "Dropped by the paper: C(xi c c) answers to the gradient of the collisional flux of charge "
        "with minus Theta times this.",
    ),
    "variance_collisional_flux": (
        "chi_5",
        "(4.2)",
        "Dropped by the paper: collisions carry variance as they carry charge, with the square of "
        "gamma.",
    ),
    "variance_covariance_exchange": (
        "chi_6",
        "(4.2)",
        "Dropped by the paper: destruction of variance by the squared covariance, 1/tau_xi.",
    ),
    "variance_covariance_regain": (
        "chi_7",
        "(4.2)",
        "Dropped by the paper: the part of it that is regained, times gamma Theta^(a/2).",
    ),
}
"""Symbol, equation and note of each coefficient.

The numbers in the notes are the paper's, for a = 4/5.
"""
