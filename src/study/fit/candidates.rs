//! Which candidate experiment would be most informative.

use nalgebra::DMatrix;

use super::FitError;
use super::case::{Compared, Component};
use super::data::{Data, Experiment};
use super::model::{Budget, Model};
use super::result::FitCandidate;
use super::statistics::Statistics;

/// Prior of a coordinate: 95 % within a factor of ten up and down.
const BEFORE: f64 = std::f64::consts::LN_10 / super::directions::NORMAL;

/// The information each of these experiments would add to the fit, the most informative
/// first. Its data are as accurate as given, or as those of the fit.
pub(super) fn rank(
    stats: &Statistics,
    wanted: &[Experiment],
) -> Result<Vec<FitCandidate>, FitError> {
    let count = stats.values.len();
    let known = stats.jacobian.transpose() * &stats.jacobian / stats.spread.powi(2);
    let known = known + DMatrix::identity(count, count) / BEFORE.powi(2);
    let mut found = Vec::new();
    for experiment in wanted {
        let data = Data {
            experiments: vec![experiment.clone()],
            ..Data::default()
        };
        let of = stats.model;
        // One leaf for each, whatever the search took.
        let data = (data, Budget::new(usize::MAX));
        let model = Model::new(of.base, of.coordinates, &of.options, data)?;
        let mut candidate = FitCandidate {
            experiment: experiment.name.clone(),
            bits: 0.0,
            shrinks: 1.0,
            remark: None,
        };
        match added(stats, &model) {
            Err(refused) => candidate.remark = Some(refused),
            Ok(added) => {
                let with = &known + &added;
                let size = |matrix: &DMatrix<f64>| {
                    let values = matrix.clone().symmetric_eigen().eigenvalues;
                    let least = values.min();
                    (values.iter().map(|value| value.log2()).sum::<f64>(), least)
                };
                let ((before, least_before), (after, least_after)) = (size(&known), size(&with));
                candidate.bits = 0.5 * (after - before);
                candidate.shrinks = (least_before / least_after).sqrt();
            }
        }
        found.push(candidate);
    }
    found.sort_by(|a, b| b.bits.total_cmp(&a.bits));
    Ok(found)
}

fn added(stats: &Statistics, model: &Model) -> Result<DMatrix<f64>, String> {
    let found = model.find(&stats.point.theta);
    let mut point = found.map_err(|refused| refused.to_string())?;
    (model.check_weights(&point)).map_err(|refused| refused.to_string())?;
    (model.differentiate(&mut point)).map_err(|_| "its equilibrium is singular".to_string())?;
    let sd = |component: &Component| match component.what {
        Compared::Result(quantity) => component.sd.or(stats.assumed(quantity.kind())),
        Compared::Vein { .. } => component.sd,
    };
    let sd: Option<Vec<f64>> = point.components().map(sd).collect();
    let sd = sd.ok_or("its standard deviation must be given (sd_frequency_1, sd_tip_x, ...)")?;
    let rows: Vec<&Vec<f64>> = point.gradients().collect();
    let jacobian = DMatrix::from_fn(rows.len(), stats.values.len(), |i, k| rows[i][k] / sd[i]);
    Ok(jacobian.transpose() * jacobian)
}
