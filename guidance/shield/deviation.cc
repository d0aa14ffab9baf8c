#include "guidance/shield/deviation.h"

#include <cmath>

namespace tbm {

Result<Deviation, AxisFailure> DeviationOf(const DesignAxis& axis,
                                           const UncertainPoint& p_in_site,
                                           std::optional<InternalChainage> hint) {
  const auto position = axis.Project(p_in_site.p, hint);
  if (!position) return Failure{position.error()};
  const double s = std::sin(position->bearing_rad);
  const double c = std::cos(position->bearing_rad);
  // A step ds along a curve moves a point that stands off to its right by ds (1 - k right).
  const double stretch = 1.0 - position->curvature_right_per_m * position->deviation_right_m;
  Eigen::Matrix3d by;  // (along, right, up) by (east, north, up)
  by.row(0) = Eigen::RowVector3d(s, c, 0.0) / stretch;
  by.row(1) = Eigen::RowVector3d(c, -s, 0.0);
  by.row(2) = Eigen::RowVector3d::UnitZ() - position->gradient.value_or(0.0) * by.row(0);
  const Eigen::Matrix3d covariance = by * p_in_site.covariance * by.transpose();
  Deviation deviation;
  deviation.chainage = position->chainage;
  deviation.official = position->official;
  deviation.right_m = position->deviation_right_m;
  deviation.up_m = position->deviation_up_m;
  deviation.along_sigma_m = std::sqrt(covariance(0, 0));
  deviation.right_sigma_m = std::sqrt(covariance(1, 1));
  deviation.up_sigma_m = std::sqrt(covariance(2, 2));
  const double product = deviation.right_sigma_m * deviation.up_sigma_m;
  if (product > 0.0) deviation.right_up_correlation = covariance(1, 2) / product;
  return deviation;
}

Result<Lead, AxisFailure> LeadOf(const DesignAxis& axis,
                                 const UncertainRigid3& site_from_shield,
                                 std::optional<InternalChainage> hint) {
  const auto foot = axis.Project(site_from_shield.b_from_a.translation, hint);
  if (!foot) return Failure{foot.error()};
  const double s = std::sin(foot->bearing_rad);
  const double c = std::cos(foot->bearing_rad);
  const Eigen::Vector3d ahead = site_from_shield.b_from_a.rotation * Eigen::Vector3d::UnitX();
  const double along = s * ahead.x() + c * ahead.y();
  const double right = c * ahead.x() - s * ahead.y();
  // Against the axis' own change of right and up per metre of chainage, which is (0, gradient).
  Lead lead;
  lead.right_per_m = right / along;
  if (foot->gradient) lead.up_per_m = ahead.z() / along - *foot->gradient;
  const Eigen::Matrix3d ahead_by = -Skew(ahead);
  const Eigen::RowVector3d along_by = s * ahead_by.row(0) + c * ahead_by.row(1);
  const Eigen::RowVector3d right_by = c * ahead_by.row(0) - s * ahead_by.row(1);
  const Eigen::Matrix3d turn = site_from_shield.covariance.topLeftCorner<3, 3>();
  const auto sigma_of = [&](double across, const Eigen::RowVector3d& across_by) {
    const Eigen::RowVector3d by = (across_by - across / along * along_by) / along;
    return std::sqrt((by * turn * by.transpose()).value());
  };
  lead.right_sigma_per_m = sigma_of(right, right_by);
  lead.up_sigma_per_m = sigma_of(ahead.z(), ahead_by.row(2));
  return lead;
}

}  // namespace tbm
