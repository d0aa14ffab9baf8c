#include "pose/rig/yaml_rotation.h"

#include <Eigen/LU>
#include <Eigen/SVD>
#include <fmt/format.h>

namespace tbm {

std::optional<Eigen::Matrix3d> RotationOf(const YamlNode& node) {
  const auto r = node.Numbers(9, {-1.001, 1.001, ""});
  if (!r) return {};
  Eigen::Matrix3d rotation;
  for (int i = 0; i < 9; ++i) rotation(i / 3, i % 3) = (*r)[static_cast<std::size_t>(i)];
  // Four printed decimals leave 1e-4 of disorder; more than 1e-3 is a wrong number.
  constexpr double kMostDisorder = 1e-3;
  const double disorder =
      (rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (disorder > kMostDisorder) {
    node.Fault(
        fmt::format("is not a rotation: its rows are off unit length or right angles by {:.2g}; "
                    "allowed is 0 .. {}",
                    disorder,
                    kMostDisorder));
    return {};
  }
  if (rotation.determinant() < 0.0) {
    node.Fault("is a mirror image, not a rotation (determinant -1): one axis points the wrong way");
    return {};
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(rotation, Eigen::ComputeFullU | Eigen::ComputeFullV);
  return svd.matrixU() * svd.matrixV().transpose();
}

}  // namespace tbm
