#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "devices/sim/drive.h"
#include "devices/sim/motion.h"
#include "pose/base/time.h"
#include "pose/geometry/rigid3.h"
#include "pose/geometry/tilt.h"
#include "pose/rig/rig.h"

namespace tbm::sim {

// A window of world time, in seconds since it began.
struct Window {
  double from_s = 0.0;
  double to_s = 1e12;

  bool Contains(double t_s) const { return t_s >= from_s && t_s < to_s; }
};

struct HiddenLed {
  std::size_t led = 0;  // index into Rig::leds
  Window window;
};

// A lamp, or the glare around it: a bright patch fixed in the image.
struct Lamp {
  Eigen::Vector2d pixel_px = Eigen::Vector2d::Zero();
  Eigen::Vector2d spread_px = {15.0, 15.0};
  double peak_dn = 600.0;  // at the reference exposure of the view, before clipping
  Window window;
};

// A second, fainter image of every LED in view: a wet wall or the window's second face. The image
// points are mirrored about a column and shifted.
struct Reflection {
  double mirror_u_px = 640.0;
  Eigen::Vector2d shift_px = {0.0, 0.0};
  bool is_mirrored = true;
  double strength = 0.4;
  Window window;
};

enum class TiltSensor { kTarget, kCamera };

// Added to what one inclinometer says. A mounting that has slipped, water in a connector.
struct TiltFault {
  TiltSensor sensor = TiltSensor::kTarget;
  Inclination offset;
  Window window;
};

struct Faults {
  std::vector<HiddenLed> hidden;
  std::vector<Lamp> lamps;
  std::vector<Reflection> reflections;
  std::vector<TiltFault> tilts;
};

struct WorldState {
  Rigid3 camera_from_target;
  Eigen::Vector3d up_in_camera = -Eigen::Vector3d::UnitY();
};

// The one truth that every simulated instrument looks at: where the target is, which way is up, and
// what is broken, each a pure function of time. Immutable, so any number of threads may ask.
class World {
 public:
  // World time is zero at `begins_at` and runs `speed` times as fast as the clock. With a tunnel
  // the machine has a place in `site`, and the camera sees what follows from it; without, camera
  // and board wander against each other as `motion` says.
  World(Rig rig,
        const Motion& motion,
        Faults faults,
        Timestamp begins_at,
        double speed = 1.0,
        std::optional<Tunnel> tunnel = {});

  WorldState At(Timestamp when) const;

  // Where both shields are; only of a world with a tunnel.
  bool has_tunnel() const { return drive_.has_value(); }
  Rigid3 SiteFromRearShield(Timestamp when) const;
  Rigid3 SiteFromFrontShield(Timestamp when) const;

  // What an inclinometer puts on its wire at `when`: with noise, faults, and in the instrument's
  // own sign convention (the rig's `sign` taken back out).
  Inclination TiltReading(TiltSensor sensor, Timestamp when) const;

  bool IsHidden(std::size_t led, Timestamp when) const;
  const Rig& rig() const { return rig_; }
  const Faults& faults() const { return faults_; }
  double SecondsAt(Timestamp when) const { return SecondsBetween(begins_at_, when) * speed_; }

 private:
  WorldState InTunnel(double t_s) const;
  double Wandered(int channel, double t_s) const;

  Rig rig_;
  Motion motion_;
  Faults faults_;
  Timestamp begins_at_;
  double speed_;
  std::optional<Drive> drive_;
};

}  // namespace tbm::sim
