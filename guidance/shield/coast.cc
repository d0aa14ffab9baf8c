#include "guidance/shield/coast.h"

namespace tbm {

UncertainRigid3 Coasted(const UncertainRigid3& site_from_shield,
                        double speed_m_per_s,
                        double speed_sigma_m_per_s,
                        double age_s,
                        const CoastOptions& options) {
  const Eigen::Matrix3d turned = site_from_shield.b_from_a.rotation.toRotationMatrix();
  UncertainRigid3 now = site_from_shield;
  now.b_from_a.translation += turned.col(0) * (speed_m_per_s * age_s);
  const double across_m = options.across_m_per_s * age_s;
  const Eigen::Vector3d shift_variance(age_s * age_s *
                                           (speed_sigma_m_per_s * speed_sigma_m_per_s +
                                            options.along_m_per_s * options.along_m_per_s),
                                       across_m * across_m,
                                       across_m * across_m);
  const double turn_rad = options.turn_rad_per_s * age_s;
  now.covariance.topLeftCorner<3, 3>().diagonal().array() += turn_rad * turn_rad;
  now.covariance.bottomRightCorner<3, 3>() +=
      turned * shift_variance.asDiagonal() * turned.transpose();
  return now;
}

Freshness FreshnessOf(std::optional<double> age_s, double sigma, const FreshnessLimits& limits) {
  if (!age_s) return Freshness::kMissing;
  const bool is_useful = limits.useful_sigma <= 0.0 || sigma <= limits.useful_sigma;
  if (!is_useful || !(*age_s <= limits.stale_after_s) || *age_s < -limits.period_s) {
    return Freshness::kStale;
  }
  return *age_s <= 2.0 * limits.period_s ? Freshness::kFresh : Freshness::kCoasting;
}

}  // namespace tbm
