//! Coefficients of the explicit Runge-Kutta method of Dormand and Prince of
//! order 8 with embedded error estimates of orders 5 and 3: those of the code
//! DOP853 in Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I,
//! 2nd ed., 1993, section II.10, to double precision.

/// Number of stages.
pub const STAGES: usize = 12;

/// Nodes of the stages.
#[rustfmt::skip]
pub const C: [f64; STAGES] = [
    0.0, 0.05260015195876773, 0.0789002279381516, 0.1183503419072274,
    0.2816496580927726, 0.3333333333333333, 0.25, 0.3076923076923077,
    0.6512820512820513, 0.6, 0.8571428571428571, 1.0,
];

/// Weights of earlier slopes in each stage.
#[rustfmt::skip]
pub const A: [&[f64]; STAGES] = [
    &[],
    &[0.05260015195876773],
    &[0.0197250569845379, 0.0591751709536137],
    &[0.02958758547680685, 0.0, 0.08876275643042054],
    &[0.2413651341592667, 0.0, -0.8845494793282861, 0.924834003261792],
    &[0.037037037037037035, 0.0, 0.0, 0.17082860872947386, 0.12546768756682242],
    &[0.037109375, 0.0, 0.0, 0.17025221101954405, 0.06021653898045596, -0.017578125],
    &[
        0.03709200011850479, 0.0, 0.0, 0.17038392571223998,
        0.10726203044637328, -0.015319437748624402, 0.008273789163814023,
    ],
    &[
        0.6241109587160757, 0.0, 0.0, -3.3608926294469414,
        -0.868219346841726, 27.59209969944671, 20.154067550477894, -43.48988418106996,
    ],
    &[
        0.47766253643826434, 0.0, 0.0, -2.4881146199716677,
        -0.590290826836843, 21.230051448181193, 15.279233632882423, -33.28821096898486,
        -0.020331201708508627,
    ],
    &[
        -0.9371424300859873, 0.0, 0.0, 5.186372428844064,
        1.0914373489967295, -8.149787010746927, -18.52006565999696, 22.739487099350505,
        2.4936055526796523, -3.0467644718982196,
    ],
    &[
        2.273310147516538, 0.0, 0.0, -10.53449546673725,
        -2.0008720582248625, -17.9589318631188, 27.94888452941996, -2.8589982771350235,
        -8.87285693353063, 12.360567175794303, 0.6433927460157636,
    ],
];

/// Weights of the result, of order 8.
#[rustfmt::skip]
pub const B: [f64; STAGES] = [
    0.054293734116568765, 0.0, 0.0,
    0.0, 0.0, 4.450312892752409,
    1.8915178993145003, -5.801203960010585, 0.3111643669578199,
    -0.1521609496625161, 0.20136540080403034, 0.04471061572777259,
];

/// Weights of the error estimate of order 5.
#[rustfmt::skip]
pub const E5: [f64; STAGES] = [
    0.01312004499419488, 0.0, 0.0,
    0.0, 0.0, -1.2251564463762044,
    -0.4957589496572502, 1.6643771824549864, -0.35032884874997366,
    0.3341791187130175, 0.08192320648511571, -0.022355307863886294,
];

/// Weights of the error estimate of order 3.
#[rustfmt::skip]
pub const E3: [f64; STAGES] = [
    -0.18980075407240762, 0.0, 0.0,
    0.0, 0.0, 4.450312892752409,
    1.8915178993145003, -5.801203960010585, -0.42268232132379197,
    -0.1521609496625161, 0.20136540080403034, 0.022651792198360825,
];

#[cfg(test)]
mod tests {
    use super::*;

    /// Order conditions of nodes, quadrature and trees with one branch.
    #[test]
    fn the_result_is_of_order_8() {
        let zero = |what: &str, off: f64| assert!(off.abs() < 1e-13, "{what}: {off:e}");
        let inner =
            |i: usize, k: i32| -> f64 { (A[i].iter().zip(C)).map(|(a, c)| a * c.powi(k)).sum() };
        for k in 0..8 {
            let sum = |value: &dyn Fn(usize) -> f64| -> f64 {
                (0..STAGES).map(|i| B[i] * value(i)).sum()
            };
            zero("b c^k", sum(&|i| C[i].powi(k)) - 1.0 / f64::from(k + 1));
            for l in 0..7 - k {
                let wanted = 1.0 / f64::from((k + 1) * (k + 2 + l));
                zero("b c^l a c^k", sum(&|i| C[i].powi(l) * inner(i, k)) - wanted);
            }
        }
        (0..STAGES).for_each(|i| zero("node", inner(i, 0) - C[i]));
    }

    /// The error estimates vanish for what methods of order 5 and 3 integrate exactly, and not
    /// for the next power.
    #[test]
    fn the_estimates_are_of_orders_5_and_3() {
        let sum = |weights: &[f64; STAGES], k: i32| -> f64 {
            (0..STAGES).map(|i| weights[i] * C[i].powi(k)).sum()
        };
        for (weights, order) in [(&E5, 5), (&E3, 3)] {
            for k in 0..order {
                assert!(sum(weights, k).abs() < 1e-13, "e c^{k}");
            }
            assert!(sum(weights, order).abs() > 1e-4);
        }
    }
}
