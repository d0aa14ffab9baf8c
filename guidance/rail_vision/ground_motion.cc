#include "guidance/rail_vision/ground_motion.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <opencv2/calib3d.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/flann/random.h>

#include "pose/calibrate/grey_mat.h"
#include "pose/geometry/rigid3.h"

namespace tbm {
namespace {

constexpr int kMostFeatures = 1500;
constexpr std::size_t kLeastFeatures = 40;
constexpr std::size_t kLeastMatches = 25;
constexpr double kLeastContrast_dn = 4.0;
constexpr float kClearlyNearer = 0.75f;  // than the next best, in distance of descriptors
constexpr double kRansac_px = 2.0;
constexpr double kLeastInliers = 0.75;  // of the matches
// Of the residuals of a free projective matrix: more and the ground is no such plane.
constexpr double kMostTimesFree = 1.6;
constexpr double kSlack_px = 0.05;
// Features look at the same pixels as their neighbours do: they count for fewer than they are.
constexpr double kShared = 1.5;
constexpr unsigned kSeed = 20260522;
// Of the ground's grade, and of its cross-fall: a tunnel's are a few percent.
constexpr double kSigmaSlope = 0.05;

struct Match {
  Eigen::Vector2d first;
  Eigen::Vector2d second;
};

std::vector<Match> Matches(const GroundFeatures& first, const GroundFeatures& second) {
  const auto table = [](const GroundFeatures& features) {
    return cv::Mat(static_cast<int>(features.points.size()),
                   GroundFeatures::kDescriptor,
                   CV_32F,
                   const_cast<float*>(features.descriptors.data()));
  };
  // Its trees split by chance.
  cvflann::seed_random(kSeed);
  cv::FlannBasedMatcher matcher(cv::makePtr<cv::flann::KDTreeIndexParams>(4),
                                cv::makePtr<cv::flann::SearchParams>(64));
  std::vector<std::vector<cv::DMatch>> nearest;
  matcher.knnMatch(table(first), table(second), nearest, 2);
  std::vector<int> times(second.points.size(), 0);
  std::vector<cv::DMatch> clear;
  for (const auto& two : nearest) {
    if (two.size() < 2 || !(two[0].distance < kClearlyNearer * two[1].distance)) continue;
    clear.push_back(two[0]);
    ++times[static_cast<std::size_t>(two[0].trainIdx)];
  }
  std::vector<Match> matches;
  for (const cv::DMatch& one : clear) {
    if (times[static_cast<std::size_t>(one.trainIdx)] != 1) continue;
    const Match match{first.points[static_cast<std::size_t>(one.queryIdx)],
                      second.points[static_cast<std::size_t>(one.trainIdx)]};
    // A point with two directions has two descriptors, and is one point.
    const bool is_known = std::any_of(matches.begin(), matches.end(), [&](const Match& other) {
      return other.first == match.first || other.second == match.second;
    });
    if (!is_known) matches.push_back(match);
  }
  return matches;
}

// The projective matrix that most matches obey: those matches, and what least squares leave of them
// per coordinate. Coordinates times f.
struct FreeFit {
  std::vector<Match> inliers;
  double rms_px = 0.0;
};
FreeFit FitFreely(const std::vector<Match>& matches, double f_px) {
  std::vector<cv::Point2d> from;
  std::vector<cv::Point2d> to;
  for (const Match& match : matches) {
    from.emplace_back(f_px * match.first.x(), f_px * match.first.y());
    to.emplace_back(f_px * match.second.x(), f_px * match.second.y());
  }
  cv::theRNG() = cv::RNG(kSeed);
  std::vector<unsigned char> is_inlier;
  FreeFit fit;
  if (cv::findHomography(from, to, cv::RANSAC, kRansac_px, is_inlier, 2000, 0.999).empty()) {
    return fit;
  }
  std::vector<cv::Point2d> from_in;
  std::vector<cv::Point2d> to_in;
  for (std::size_t i = 0; i < matches.size(); ++i) {
    if (is_inlier[i] == 0) continue;
    fit.inliers.push_back(matches[i]);
    from_in.push_back(from[i]);
    to_in.push_back(to[i]);
  }
  if (fit.inliers.size() < kLeastMatches) return fit;
  const cv::Mat matrix = cv::findHomography(from_in, to_in);
  if (matrix.empty()) return fit;
  std::vector<cv::Point2d> expected;
  cv::perspectiveTransform(from_in, expected, matrix);
  double sum = 0.0;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    const cv::Point2d off = expected[i] - to_in[i];
    sum += off.dot(off);
  }
  fit.rms_px = std::sqrt(sum / (2.0 * static_cast<double>(expected.size()) - 8.0));
  return fit;
}

// Least squares of shift (in heights), small turn, and slope of the ground.
class PlaneFit {
 public:
  PlaneFit(const std::vector<Match>& matches, const GroundAttitudes& attitudes, double f_px)
      : matches_(matches),
        f_px_(f_px),
        up_in_first_(attitudes.world_from_first.conjugate() * Eigen::Vector3d::UnitZ()),
        second_from_first_(attitudes.world_from_second.conjugate() * attitudes.world_from_first) {
    level_in_first_.col(0) = up_in_first_.unitOrthogonal();
    level_in_first_.col(1) = up_in_first_.cross(level_in_first_.col(0));
    by_sigma2_.segment<3>(kTurn).setConstant(1.0 / Square(attitudes.sigma_turn_rad));
    by_sigma2_.segment<2>(kSlope).setConstant(1.0 / Square(kSigmaSlope));
  }

  // Nothing where a ray of the image does not reach the ground, or no minimum is found.
  std::optional<GroundMotion> Solve() {
    constexpr int kRounds = 30;
    const auto count = static_cast<double>(matches_.size());
    // What is known before needs the points' noise to be weighed against: a guess first.
    double rms_px = 0.3;
    State state = State::Zero();
    for (int round = 0; round < kRounds; ++round) {
      Normal normal = Normal::Zero();
      State right = State::Zero();
      double sum = 0.0;
      const Scene scene = At(state);
      for (const Match& match : matches_) {
        if (!Add(match, scene, &normal, &right, &sum)) return {};
      }
      const State prior = kShared * rms_px * rms_px * by_sigma2_;
      normal.diagonal() += prior;
      right -= prior.cwiseProduct(state);
      const Eigen::LDLT<Normal> solver(normal);
      const State step = solver.solve(right);
      if (!step.allFinite()) return {};
      state += step;
      const double seen_px = std::max(1e-3, std::sqrt(sum / (2.0 * count - 3.0)));
      const bool is_settled = step.norm() < 1e-10 && std::abs(seen_px - rms_px) < 1e-6;
      rms_px = seen_px;
      if (!is_settled) continue;
      GroundMotion motion;
      motion.moved = state.head<3>();
      motion.turn_rad = state.segment<3>(kTurn);
      motion.covariance = kShared * rms_px * rms_px * normal.inverse().topLeftCorner<3, 3>();
      motion.rms_px = rms_px;
      motion.inliers = matches_.size();
      return motion;
    }
    return {};
  }

 private:
  // Shift, turn, slope along two level directions.
  static constexpr int kTurn = 3;
  static constexpr int kSlope = 6;
  static constexpr int kSize = 8;
  using State = Eigen::Matrix<double, kSize, 1>;
  using Normal = Eigen::Matrix<double, kSize, kSize>;

  static double Square(double value) { return value * value; }

  struct Scene {
    Eigen::Vector3d shift;
    Eigen::Matrix3d turn;
    Eigen::Vector3d normal;  // of the ground, upwards, in the first camera
    Eigen::Matrix<double, 3, 2> normal_by_slope;
  };
  Scene At(const State& state) const {
    Scene scene;
    scene.shift = state.head<3>();
    scene.turn = (ExpRotation(state.segment<3>(kTurn)) * second_from_first_).toRotationMatrix();
    const Eigen::Vector3d leaning = up_in_first_ + level_in_first_ * state.tail<2>();
    scene.normal = leaning.normalized();
    scene.normal_by_slope =
        (level_in_first_ - scene.normal * (scene.normal.transpose() * level_in_first_)) /
        leaning.norm();
    return scene;
  }

  bool Add(
      const Match& match, const Scene& scene, Normal* normal, State* right, double* sum) const {
    const Eigen::Vector3d ray = match.first.homogeneous();
    const double down = -scene.normal.dot(ray);
    if (down < 0.05) return false;
    const Eigen::Vector3d in_second = scene.turn * (ray / down - scene.shift);
    if (in_second.z() < 0.05) return false;
    const double z = in_second.z();
    Eigen::Matrix<double, 2, 3> by_point;
    by_point << 1.0 / z, 0.0, -in_second.x() / (z * z), 0.0, 1.0 / z, -in_second.y() / (z * z);
    by_point *= f_px_;
    Eigen::Matrix<double, 2, kSize> by_state;
    by_state.leftCols<3>() = -by_point * scene.turn;
    by_state.middleCols<3>(kTurn) = -by_point * Skew(in_second);
    by_state.rightCols<2>() =
        by_point * (scene.turn * ray) / (down * down) * (ray.transpose() * scene.normal_by_slope);
    const Eigen::Vector2d off_px = f_px_ * (match.second - in_second.hnormalized());
    *normal += by_state.transpose() * by_state;
    *right += by_state.transpose() * off_px;
    *sum += off_px.squaredNorm();
    return true;
  }

  const std::vector<Match>& matches_;
  const double f_px_;
  const Eigen::Vector3d up_in_first_;
  Eigen::Matrix<double, 3, 2> level_in_first_;
  const Eigen::Quaterniond second_from_first_;
  State by_sigma2_ = State::Zero();  // 1 / sigma^2 of what is known before
};

std::optional<GroundFailure> Unusable(const GroundFeatures& features) {
  if (features.contrast_dn < kLeastContrast_dn) return GroundFailure::kNoTexture;
  if (features.points.size() < kLeastFeatures) return GroundFailure::kBlurred;
  return {};
}

}  // namespace

GroundFeatures FindGroundFeatures(const ImageView& image, const CameraModel& camera) {
  GroundFeatures features;
  if (image.pixels == nullptr || image.width_px < 32 || image.height_px < 32) return features;
  const cv::Mat grey = GreyOf(image);
  cv::Scalar mean;
  cv::Scalar sigma;
  cv::meanStdDev(grey, mean, sigma);
  features.contrast_dn = sigma[0];
  std::vector<cv::KeyPoint> points;
  cv::Mat descriptors;
  cv::SIFT::create(kMostFeatures)->detectAndCompute(grey, cv::noArray(), points, descriptors);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto ideal = NormalisedFromPixel(camera, {points[i].pt.x, points[i].pt.y});
    if (!ideal) continue;
    features.points.push_back(*ideal);
    const float* row = descriptors.ptr<float>(static_cast<int>(i));
    features.descriptors.insert(features.descriptors.end(), row, row + GroundFeatures::kDescriptor);
  }
  return features;
}

const char* Word(GroundFailure failure) {
  switch (failure) {
    case GroundFailure::kNoTexture:
      return "no_texture";
    case GroundFailure::kBlurred:
      return "blurred";
    case GroundFailure::kTooFewMatches:
      return "too_few_matches";
    case GroundFailure::kNotAPlane:
      return "not_a_plane";
  }
  return "";
}

Result<GroundMotion, GroundFailure> MeasureGroundMotion(const GroundFeatures& first,
                                                        const GroundFeatures& second,
                                                        const CameraModel& camera,
                                                        const GroundAttitudes& attitudes) {
  for (const GroundFeatures* features : {&first, &second}) {
    if (const auto why = Unusable(*features)) return Failure{*why};
  }
  const std::vector<Match> matches = Matches(first, second);
  if (matches.size() < kLeastMatches) return Failure{GroundFailure::kTooFewMatches};
  const FreeFit free = FitFreely(matches, camera.fx_px);
  if (free.inliers.size() < kLeastMatches) return Failure{GroundFailure::kTooFewMatches};
  const auto least = kLeastInliers * static_cast<double>(matches.size());
  if (static_cast<double>(free.inliers.size()) < least) return Failure{GroundFailure::kNotAPlane};
  auto motion = PlaneFit(free.inliers, attitudes, camera.fx_px).Solve();
  if (!motion || motion->rms_px > kMostTimesFree * free.rms_px + kSlack_px) {
    return Failure{GroundFailure::kNotAPlane};
  }
  motion->matches = matches.size();
  return *motion;
}

}  // namespace tbm
