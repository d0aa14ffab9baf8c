#pragma once

#include <functional>

#include "devices/sim/motion.h"
#include "pose/geometry/rigid3.h"

namespace tbm::sim {

// The tunnel that the machine drives, and how camera and board are built into it.
struct Tunnel {
  // The design axis at a chainage, for every number: x along the drive and climbing with it, y
  // left and horizontal, z square to both. Asked from any thread.
  std::function<Rigid3(double chainage_m)> site_from_axis;
  Rigid3 rear_shield_from_camera;
  Rigid3 front_shield_from_target;
  double start_chainage_m = 0.0;  // of the rear shield's datum when the world begins
  double closed_joint_m = 0.0;    // the front shield's is so much further on

  // The route that is driven leaves the design by this much to each side.
  double wander_m = 0.025;
  double wander_length_m = 60.0;
  double crab_rad = 0.0008;  // each shield points past its own route
  double roll_rad = 0.004;
};

// Both shields on their way through the tunnel, as functions of world time. The front one follows
// the design with a smooth wander; the rear one comes along the same route behind it, stands while
// the front one bores a stroke, and is pulled after it.
class Drive {
 public:
  Drive(Tunnel tunnel, const Motion& motion);

  Rigid3 SiteFromRearShield(double t_s) const;
  Rigid3 SiteFromFrontShield(double t_s) const;  // with vibration

  const Tunnel& tunnel() const { return tunnel_; }

 private:
  Rigid3 OnRoute(double chainage_m, int crab_channel, int roll_channel) const;

  Tunnel tunnel_;
  Motion motion_;
};

}  // namespace tbm::sim
