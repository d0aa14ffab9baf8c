#pragma once

#include <array>
#include <optional>
#include <string_view>
#include <vector>

#include "guidance/config/guidance_file.h"
#include "guidance/core/guidance_core.h"
#include "tests/guidance/axis/truth.h"
#include "tests/support/random.h"

namespace tbm::test {

// What may be wrong in a drive, each by itself or all together.
enum class ErrorSource {
  kStationReading,  // angles and distances of the total station
  kStationSetUp,    // its place and orientation
  kPrisms,          // where the prisms are in the shield
  kCameraPlace,     // where the camera is in the rear shield
  kBoardPlace,      // where the LED board is in the front shield, and the cutter's centre
  kLedCentres,      // noise of the centres in the image
  kCameraModel,     // lens, calibration residual
  kLedPlaces,       // where the LEDs are on the board
  kTiltReading,     // noise of both inclinometers
  kTiltMounting,    // how they are bolted on
};
inline constexpr int kErrorSources = 10;
std::string_view WordsOf(ErrorSource source);

// Sigmas of real instruments that no file of the machine names.
struct DriveNoise {
  double angle_rad = 4.85e-6;  // 1 second of arc
  double slope_m = 0.0006;
  double slope_ppm = 1.0;
  double station_m = 0.001;  // each coordinate of the set-up
  double station_zero_rad = 7e-6;
  double centre_px = 0.1;
  double station_distance_m = 80.0;  // from the total station to the rear shield
};

// A simulated drive along the example tunnel. The place and direction of the axis come from a
// numerical integration of the drawing (truth.h), the machine stands beside it by amounts that are
// put in, and the instruments see it by geometry that is written out here; of the code under test
// only the sight of the total station is used on the way there.
//
// Each epoch is another machine, set-up and round of readings: an error that is common to a whole
// drive would leave one draw, and nothing could be said of its sigma.
class Drive {
 public:
  Drive(const GuidedMachine& machine, const DriveNoise& noise, std::string_view stream);

  // Only these errors are there; all of them to begin with. What is expected of them stays.
  void Only(std::optional<ErrorSource> source) { only_ = source; }

  // What the operator was told in the middle of an epoch, and what was true. Chainages must grow.
  struct Epoch {
    Snapshot snapshot;
    double right_m = 0.0;  // of the point that one steers by
    double up_m = 0.0;
    double chainage_m = 0.0;
  };
  Epoch Measure(double chainage_m);

  // The inputs of the last epoch, for whoever takes its steps again.
  const std::vector<GuidanceInput>& inputs() const { return inputs_; }
  Timestamp now() const { return now_; }

 private:
  struct Foot {
    Eigen::Vector3d p_in_site;
    double heading_rad;  // anticlockwise from east
    double gradient;
  };
  struct Walker {
    double at_m;
    TruthState state;
  };
  Foot FootAt(Walker& walker, double chainage_m) const;
  Rigid3 Beside(const Foot& foot,
                double right_m,
                double up_m,
                const Eigen::Vector3d& datum_in_shield);
  bool Has(ErrorSource source) const { return !only_ || *only_ == source; }
  Eigen::Vector3d Drawn3(ErrorSource source, double sigma);
  double Drawn(ErrorSource source, double sigma);
  Rigid3 Built(ErrorSource source, const UncertainRigid3& drawing);
  Rig BuiltRig();
  void SeePrisms(const Rigid3& site_from_rear,
                 const Rig& built,
                 const Rigid3& rear_from_camera,
                 RelativeSeen board);
  void SeeTilts(const Rig& built,
                const Eigen::Vector3d& up_in_camera,
                std::optional<Eigen::Vector3d> up_in_target,
                Timestamp around);
  RelativeSeen SeeBoard(const Rig& built,
                        const Rigid3& camera_from_target,
                        const Eigen::Vector3d& up_in_camera);

  const GuidedMachine& machine_;
  DriveNoise noise_;
  Random random_;
  GuidanceCore core_;
  std::optional<ErrorSource> only_;
  Walker front_;
  Walker rear_;
  Timestamp now_{1'700'000'000'000'000'000};
  std::uint64_t set_up_number_ = 0;
  std::vector<GuidanceInput> inputs_;
};

// The example machine, rig and axis of the project.
GuidedMachine ExampleMachine();

}  // namespace tbm::test
