#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

namespace tbm {

// Where a target is expected: pixel, and its derivative by the errors of whatever state predicts
// it. Errors of the state move all targets together, which is what tells them apart.
struct ExpectedPixel {
  Eigen::Vector2d pixel_px = Eigen::Vector2d::Zero();
  Eigen::Matrix<double, 2, Eigen::Dynamic> by_state;
  double survey_sigma_px = 0.0;  // of the target's own coordinates, in the image
  double px_per_m = 0.0;         // size in the image of what is one metre wide and faces the camera
};

// What a filter expects of an image: an entry for each target, none where it lies behind the
// camera.
struct ExpectedImage {
  std::vector<std::optional<ExpectedPixel>> targets;
  Eigen::MatrixXd covariance;  // of the state's errors
  double focal_px = 0.0;       // of the camera, > 0
};

// The gates in which targets may lie. They shrink with each target that was found: once the image
// has shown two of them, the others have hardly a place left.
class TargetGates {
 public:
  explicit TargetGates(const ExpectedImage& expected)
      : expected_(expected),
        e_(Eigen::VectorXd::Zero(expected.covariance.rows())),
        covariance_(expected.covariance) {}

  bool Expects(std::size_t target) const { return expected_.targets[target].has_value(); }
  const ExpectedPixel& Expected(std::size_t target) const { return *expected_.targets[target]; }

  struct Gate {
    Eigen::Vector2d pixel_px;
    Eigen::Matrix2d covariance_px2;

    // Squared distance in sigmas, chi-squared of two degrees of freedom where the target lies
    // there.
    double Distance(const Eigen::Vector2d& pixel_px) const;
    bool Has(const Eigen::Vector2d& pixel_px) const;
    double HalfWidth_px() const;  // of the box around it, the longer side
    double Area_px2() const;
  };
  // Of an image point measured to `sigma_px`.
  Gate At(std::size_t target, double sigma_px) const;

  // The target was found there: the state's errors are known better by that.
  void Take(std::size_t target, const Eigen::Vector2d& pixel_px, double sigma_px);

 private:
  const ExpectedImage& expected_;
  // What the straight line from error to pixel leaves out, where the error is large.
  double Bend_px(const Eigen::Vector2d& moved_px, const Eigen::Matrix2d& covariance_px2) const;

  Eigen::VectorXd e_;
  Eigen::MatrixXd covariance_;
};

// An image point that may be some target.
struct GateCandidate {
  Eigen::Vector2d pixel_px = Eigen::Vector2d::Zero();
  double sigma_px = 0.0;
  double diameter_px = 0.0;  // 0: has no size, as a lamp
  double bias_px = 0.0;      // part of sigma that stays the same from image to image
};

enum class MatchVerdict { kMatched, kNothingThere, kAmbiguous };
struct GateMatch {
  std::size_t target = 0;
  MatchVerdict verdict = MatchVerdict::kNothingThere;
  std::size_t candidate = 0;  // kMatched
};

// Which of `candidates` is which of `targets`. A pair is made only where the target's gate holds no
// other candidate, the candidate lies in no other target's gate, and a stray candidate, as often as
// they are found over the image's `area_px2`, is hardly to be expected in a gate of that size. The
// pair with the smallest gate is made first and taken into `gates`; whoever is left when no further
// pair can be made stays without one. `diameters_m`: of each target, 0 where it has none.
std::vector<GateMatch> MatchInGates(const std::vector<std::size_t>& targets,
                                    const std::vector<double>& diameters_m,
                                    const std::vector<GateCandidate>& candidates,
                                    double area_px2,
                                    TargetGates* gates);

}  // namespace tbm
