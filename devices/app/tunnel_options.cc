#include "devices/app/tunnel_options.h"

#include <algorithm>
#include <memory>
#include <utility>

#include <fmt/format.h>

#include "guidance/axis/design_axis.h"
#include "guidance/config/axis_file.h"
#include "pose/base/check.h"

namespace tbm {
namespace {

constexpr double kDefaultStart_m = 60.0;

Result<DesignAxis, std::string> LoadAxis(const MachineFile& file) {
  const auto loaded = LoadAxisFile(file.axis_file, file.axis_options);
  std::string problems;
  if (!loaded) {
    for (const AxisFileFault& fault : loaded.error()) problems += fault.Text() + "\n";
    return Failure{problems};
  }
  auto axis = DesignAxis::Build(loaded->description);
  if (!axis) {
    for (const AxisRemark& remark : axis.error()) {
      problems += RemarkText(remark, file.axis_file) + "\n";
    }
    return Failure{problems};
  }
  return std::move(axis).value();
}

// Frame of the axis with its x along the slope; straight on beyond both ends.
Rigid3 SiteFromAxis(const DesignAxis& axis, double chainage_m) {
  const double inside_m = std::clamp(chainage_m, axis.start().m, axis.end().m);
  const auto point = axis.At({inside_m});
  TBM_CHECK(point.has_value());
  const Eigen::Vector3d forward = *point->direction_in_site();
  const Eigen::Vector3d left = Eigen::Vector3d::UnitZ().cross(forward).normalized();
  Eigen::Matrix3d rotation;
  rotation << forward, left, forward.cross(left);
  const double plan_per_m = forward.head<2>().norm();
  return {Eigen::Quaterniond(rotation).normalized(),
          *point->p_in_site() + (chainage_m - inside_m) / plan_per_m * forward};
}

}  // namespace

Result<LoadedTunnel, std::string> LoadTunnel(const std::string& machine_file,
                                             std::optional<double> start_chainage_m) {
  auto file = LoadMachineFile(machine_file);
  std::string problems;
  if (!file) {
    for (const RigFileFault& fault : file.error()) problems += fault.Text() + "\n";
    return Failure{problems};
  }
  auto built = LoadAxis(*file);
  if (!built) return Failure{built.error()};
  const auto axis = std::make_shared<const DesignAxis>(std::move(built).value());
  if (!axis->At(axis->start())->up_m || !axis->At(axis->end())->up_m) {
    return Failure{
        fmt::format("{}: has no heights from end to end; a machine needs them\n", file->axis_file)};
  }
  const double start_m = start_chainage_m.value_or(axis->start().m + kDefaultStart_m);
  if (start_m < axis->start().m || start_m > axis->end().m) {
    return Failure{fmt::format("--chainage {}: the axis runs from {:.3f} to {:.3f}\n",
                               start_m,
                               axis->start().m,
                               axis->end().m)};
  }
  const Machine& machine = file->machine;
  sim::Tunnel tunnel;
  tunnel.site_from_axis = [axis](double chainage_m) { return SiteFromAxis(*axis, chainage_m); };
  tunnel.rear_shield_from_camera = machine.geometry.rear_shield_from_camera.b_from_a;
  tunnel.front_shield_from_target = machine.geometry.front_shield_from_target.b_from_a;
  tunnel.start_chainage_m = start_m;
  tunnel.closed_joint_m = machine.closed_joint_m.value_or(0.0);
  return LoadedTunnel{std::move(file).value(), std::move(tunnel)};
}

}  // namespace tbm
