#include "pose/calibrate/camera_calibration.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

#include "pose/calibrate/board_pose.h"

namespace tbm {
namespace {

using Points = std::vector<Eigen::Vector3d>;
using Views = std::span<const std::vector<Eigen::Vector2d>>;
using Indices = std::vector<std::size_t>;

constexpr std::size_t kLeastPictures = 5;
constexpr int kMostSteps = 40;
constexpr double kBadPicture = 3.0;  // times the median
// What no lens bends a plane by, as long as a board's points are where they are said to be.
constexpr double kBadPlane = 10.0;  // times the median
constexpr double kBadPlane_px = 5.0;
const double kNone = std::numeric_limits<double>::quiet_NaN();

struct Setting {
  Board board;
  Points points;
  Views views;
  cv::Size size;
  int parameters;  // 8, or 9 with k3
};

struct Fit {
  CameraModel camera;
  std::vector<Rigid3> poses;  // of the pictures used, in order
  std::vector<ViewNormal> normals;
  IntrinsicMatrix cofactor = IntrinsicMatrix::Zero();
  double sum_px2 = 0.0;
};

double MedianOf(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

double RmsOf(double sum_px2, std::size_t points) {
  return std::sqrt(sum_px2 / (2.0 * static_cast<double>(points)));
}

Rigid3 PoseOf(const cv::Mat& turn, const cv::Mat& shift) {
  const Eigen::Vector3d turn_rad(turn.at<double>(0), turn.at<double>(1), turn.at<double>(2));
  return {ExpRotation(turn_rad), {shift.at<double>(0), shift.at<double>(1), shift.at<double>(2)}};
}

// OpenCV's own calibration, in single precision points as it wants them.
std::optional<Fit> Start(const Setting& setting, const Indices& used) {
  std::vector<cv::Point3f> board;
  for (const Eigen::Vector3d& p : setting.points) {
    board.emplace_back(static_cast<float>(p.x()), static_cast<float>(p.y()), 0.0f);
  }
  const std::vector<std::vector<cv::Point3f>> object(used.size(), board);
  std::vector<std::vector<cv::Point2f>> image;
  for (const std::size_t index : used) {
    auto& pixels = image.emplace_back();
    for (const Eigen::Vector2d& pixel : setting.views[index]) {
      pixels.emplace_back(static_cast<float>(pixel.x()), static_cast<float>(pixel.y()));
    }
  }
  cv::Mat matrix;
  cv::Mat distortion;
  std::vector<cv::Mat> turns;
  std::vector<cv::Mat> shifts;
  try {
    cv::calibrateCamera(object,
                        image,
                        setting.size,
                        matrix,
                        distortion,
                        turns,
                        shifts,
                        setting.parameters == kIntrinsics ? 0 : cv::CALIB_FIX_K3);
  } catch (const cv::Exception&) {
    return std::nullopt;
  }
  Fit fit;
  fit.camera = {setting.size.width,
                setting.size.height,
                matrix.at<double>(0, 0),
                matrix.at<double>(1, 1),
                matrix.at<double>(0, 2),
                matrix.at<double>(1, 2),
                distortion.at<double>(0),
                distortion.at<double>(1),
                distortion.at<double>(2),
                distortion.at<double>(3),
                setting.parameters == kIntrinsics ? distortion.at<double>(4) : 0.0};
  for (std::size_t i = 0; i < used.size(); ++i) fit.poses.push_back(PoseOf(turns[i], shifts[i]));
  return fit;
}

// Fills normals and sum. False where a point would lie behind the camera.
bool Linearise(const Setting& setting, const Indices& used, Fit* fit) {
  fit->normals.clear();
  fit->sum_px2 = 0.0;
  for (std::size_t i = 0; i < used.size(); ++i) {
    auto normal = LinearisedView(
        setting.board, setting.points, setting.views[used[i]], fit->camera, fit->poses[i]);
    if (!normal) return false;
    fit->sum_px2 += normal->sum_px2;
    fit->normals.push_back(std::move(*normal));
  }
  return std::isfinite(fit->sum_px2);
}

struct Step {
  IntrinsicVector camera = IntrinsicVector::Zero();
  std::vector<PoseError> poses;
};

// Placements are eliminated picture by picture; what is left is the camera's own information, whose
// inverse goes into the fit.
std::optional<Step> Solve(int parameters, Fit* fit) {
  IntrinsicMatrix information = IntrinsicMatrix::Zero();
  IntrinsicVector pull = IntrinsicVector::Zero();
  for (const ViewNormal& normal : fit->normals) {
    const Eigen::LDLT<Eigen::Matrix<double, 6, 6>> by_pose(normal.by_pose);
    information += normal.by_camera - normal.between * by_pose.solve(normal.between.transpose());
    pull += normal.pull_camera - normal.between * by_pose.solve(normal.pull_pose);
  }
  const Eigen::MatrixXd estimated = information.topLeftCorner(parameters, parameters);
  // Focal lengths and distortion differ by five orders; scaled, the rank shows.
  const Eigen::VectorXd scale = estimated.diagonal().cwiseMax(1e-30).cwiseSqrt().cwiseInverse();
  const Eigen::LDLT<Eigen::MatrixXd> scaled(scale.asDiagonal() * estimated * scale.asDiagonal());
  if (scaled.info() != Eigen::Success || !(scaled.vectorD().minCoeff() > 1e-13)) {
    return std::nullopt;
  }
  const Eigen::MatrixXd inverse = scaled.solve(Eigen::MatrixXd::Identity(parameters, parameters));
  fit->cofactor.setZero();
  fit->cofactor.topLeftCorner(parameters, parameters) =
      scale.asDiagonal() * inverse * scale.asDiagonal();
  Step step;
  step.camera = fit->cofactor * pull;
  for (const ViewNormal& normal : fit->normals) {
    step.poses.push_back(
        normal.by_pose.ldlt().solve(normal.pull_pose - normal.between.transpose() * step.camera));
  }
  return step;
}

Fit MovedFit(const Fit& fit, const Step& step, double share) {
  Fit moved;
  moved.camera = MovedCamera(fit.camera, share * step.camera);
  moved.cofactor = fit.cofactor;
  for (std::size_t i = 0; i < fit.poses.size(); ++i) {
    moved.poses.push_back(Moved(fit.poses[i], share * step.poses[i]));
  }
  return moved;
}

std::optional<Fit> FitOf(const Setting& setting, const Indices& used) {
  auto fit = Start(setting, used);
  if (!fit || !Linearise(setting, used, &*fit)) return std::nullopt;
  for (int i = 0; i < kMostSteps; ++i) {
    const auto step = Solve(setting.parameters, &*fit);
    if (!step || !step->camera.allFinite()) return std::nullopt;
    bool is_better = false;
    Fit next;
    for (double share = 1.0; share > 1e-3 && !is_better; share *= 0.5) {
      next = MovedFit(*fit, *step, share);
      is_better = Linearise(setting, used, &next) && next.sum_px2 <= fit->sum_px2;
    }
    if (!is_better) break;
    const double gain = fit->sum_px2 - next.sum_px2;
    fit = std::move(next);
    if (gain <= 1e-12 * fit->sum_px2) break;
  }
  // The covariance belongs to where the search ended.
  if (!Solve(setting.parameters, &*fit)) return std::nullopt;
  return fit;
}

// Root mean square of what a plane-to-image projectivity leaves: no camera is needed for it, so it
// finds the picture whose points are not where the board has them, before that spoils the camera.
double PlaneRms_px(const Points& points, std::span<const Eigen::Vector2d> pixels) {
  std::vector<cv::Point2d> from;
  std::vector<cv::Point2d> to;
  for (std::size_t i = 0; i < points.size(); ++i) {
    from.emplace_back(points[i].x(), points[i].y());
    to.emplace_back(pixels[i].x(), pixels[i].y());
  }
  try {
    const cv::Mat h = cv::findHomography(from, to);
    if (h.empty()) return std::numeric_limits<double>::infinity();
    std::vector<cv::Point2d> expected;
    cv::perspectiveTransform(from, expected, h);
    double sum = 0.0;
    for (std::size_t i = 0; i < to.size(); ++i) {
      const cv::Point2d off = to[i] - expected[i];
      sum += off.dot(off);
    }
    return RmsOf(sum, to.size());
  } catch (const cv::Exception&) {
    return std::numeric_limits<double>::infinity();
  }
}

Indices FlatPictures(const Setting& setting) {
  std::vector<double> rms_px;
  for (const auto& pixels : setting.views) rms_px.push_back(PlaneRms_px(setting.points, pixels));
  const double most_px = std::max(kBadPlane_px, kBadPlane * MedianOf(rms_px));
  Indices used;
  for (std::size_t i = 0; i < rms_px.size(); ++i) {
    if (rms_px[i] <= most_px) used.push_back(i);
  }
  return used;
}

// The one that fits worst, where it fits much worse than most. As place among the used ones.
std::optional<std::size_t> WorstOf(const Fit& fit, std::size_t points) {
  std::vector<double> rms_px;
  for (const ViewNormal& normal : fit.normals) rms_px.push_back(RmsOf(normal.sum_px2, points));
  const auto worst = std::max_element(rms_px.begin(), rms_px.end());
  if (*worst <= kBadPicture * MedianOf(rms_px)) return std::nullopt;
  return static_cast<std::size_t>(worst - rms_px.begin());
}

Coverage CoverageOfUsed(const Setting& setting, const Indices& used) {
  std::vector<std::vector<Eigen::Vector2d>> views;
  for (const std::size_t index : used) views.push_back(setting.views[index]);
  return CoverageOf(views, setting.size.width, setting.size.height);
}

// Tilts where no camera could be fitted. A camera of common focal length tells flat from tilted.
void GuessTilts(const Setting& setting, const Indices& used, Coverage* coverage) {
  CameraModel guess;
  guess.image_width_px = setting.size.width;
  guess.image_height_px = setting.size.height;
  guess.fx_px = guess.fy_px = 1.2 * setting.size.width;
  guess.cx_px = 0.5 * (setting.size.width - 1);
  guess.cy_px = 0.5 * (setting.size.height - 1);
  std::vector<Rigid3> poses;
  for (const std::size_t index : used) {
    const auto placed = PlaceBoard(setting.board, setting.views[index], guess);
    if (placed) poses.push_back(placed->camera_from_board);
  }
  SetTilts(poses, coverage);
}

bool CanBeUndone(const CameraModel& camera) {
  const double right_px = camera.image_width_px - 1.0;
  const double bottom_px = camera.image_height_px - 1.0;
  for (const double u_px : {0.0, 0.5 * right_px, right_px}) {
    for (const double v_px : {0.0, 0.5 * bottom_px, bottom_px}) {
      if (!NormalisedFromPixel(camera, {u_px, v_px})) return false;
    }
  }
  return true;
}

std::vector<CalibrationPicture> PicturesOf(const Setting& setting,
                                           const Indices& used,
                                           const Fit& fit) {
  std::vector<CalibrationPicture> pictures(setting.views.size());
  for (CalibrationPicture& picture : pictures) picture.used = false;
  for (std::size_t i = 0; i < used.size(); ++i) {
    CalibrationPicture& picture = pictures[used[i]];
    picture.used = true;
    picture.camera_from_board = fit.poses[i];
    picture.residuals_px = fit.normals[i].residuals_px;
    picture.rms_px = RmsOf(fit.normals[i].sum_px2, setting.points.size());
  }
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    CalibrationPicture& picture = pictures[i];
    if (picture.used) continue;
    auto placed = PlaceBoard(setting.board, setting.views[i], fit.camera);
    picture.is_placed = placed.has_value();
    if (!placed) continue;
    picture.camera_from_board = placed->camera_from_board;
    picture.rms_px = RmsOf(placed->sum_px2, setting.points.size());
    picture.residuals_px = placed->residuals_px;
  }
  return pictures;
}

Indices OthersThan(const Indices& used, std::size_t count) {
  Indices others;
  for (std::size_t i = 0; i < count; ++i) {
    if (std::find(used.begin(), used.end(), i) == used.end()) others.push_back(i);
  }
  return others;
}

// A camera from the pictures that fit one another: `used` shrinks. Empty where there is none.
std::optional<Fit> FitWithoutBad(const Setting& setting, Indices* used) {
  for (;;) {
    auto fit = FitOf(setting, *used);
    if (!fit) return std::nullopt;
    const auto worst = WorstOf(*fit, setting.points.size());
    if (!worst) return fit;
    used->erase(used->begin() + static_cast<std::ptrdiff_t>(*worst));
    if (used->size() < kLeastPictures) return std::nullopt;
  }
}

// What is wrong with a result, the cause before its effects.
std::optional<CameraCalibrationFault> FaultIn(const std::optional<Fit>& fit,
                                              const CameraCalibrationFailure& facts,
                                              std::size_t given,
                                              const CameraCalibrationOptions& options) {
  using enum CameraCalibrationFault;
  if (3 * facts.left_out.size() > given) return kDisagree;
  if (given - facts.left_out.size() < kLeastPictures) return kTooFew;
  if (!facts.coverage.missing.empty()) return kUncovered;
  if (!facts.coverage.IsTilted()) return kTooFlat;
  if (!fit) return kNoFit;
  if (!(facts.residual_px <= options.most_residual_px)) return kTooCoarse;
  if (!(facts.focal_sigma <= options.most_focal_sigma)) return kTooWeak;
  if (!CanBeUndone(fit->camera)) return kFolds;
  return std::nullopt;
}

}  // namespace

std::string Advice(const CameraCalibrationFailure& failure) {
  using enum CameraCalibrationFault;
  const std::string missing = MissingPictures(failure.coverage);
  switch (failure.fault) {
    case kTooFew:
      return "take at least five pictures that show the board whole, better twenty";
    case kUncovered:
    case kTooFlat:
      return missing;
    case kTooWeak:
      return "the focal length is not known well enough: tilt the board further, come nearer, or "
             "take more pictures";
    case kDisagree:
      return "more than a third of the pictures do not fit the others: the board bends, the camera "
             "is refocused between them, or --board counts other points";
    case kTooCoarse:
      return "the points lie too far from where any such camera would see them: the board is not "
             "flat, pictures are blurred by motion, or the lens is no pinhole with k1 k2 p1 p2";
    case kNoFit:
      return missing.empty() ? "no camera fits these pictures" : missing;
    case kFolds:
      return "the distortion found cannot be undone in the corners of the image: bring the board "
             "nearer to them, and leave k3 out";
  }
  return "";
}

Result<CameraCalibration, CameraCalibrationFailure> CalibrateCamera(
    const Board& board,
    Views views,
    int image_width_px,
    int image_height_px,
    const CameraCalibrationOptions& options) {
  const Setting setting{board,
                        BoardPoints(board),
                        views,
                        {image_width_px, image_height_px},
                        options.with_k3 ? kIntrinsics : kIntrinsics - 1};
  CameraCalibrationFailure facts;
  facts.coverage = CoverageOf(views, image_width_px, image_height_px);
  facts.residual_px = kNone;
  facts.focal_sigma = kNone;
  if (views.size() < kLeastPictures) {
    facts.fault = CameraCalibrationFault::kTooFew;
    return Failure{facts};
  }
  Indices used = FlatPictures(setting);
  std::optional<Fit> fit;
  if (used.size() >= kLeastPictures) fit = FitWithoutBad(setting, &used);
  facts.left_out = OthersThan(used, views.size());
  facts.coverage = CoverageOfUsed(setting, used);
  int dof = 0;
  if (fit) {
    SetTilts(fit->poses, &facts.coverage);
    dof = static_cast<int>(2 * used.size() * setting.points.size() - 6 * used.size()) -
          setting.parameters;
    facts.residual_px = std::sqrt(fit->sum_px2 / dof);
    facts.focal_sigma =
        facts.residual_px * std::max(std::sqrt(fit->cofactor(0, 0)) / fit->camera.fx_px,
                                     std::sqrt(fit->cofactor(1, 1)) / fit->camera.fy_px);
  } else {
    GuessTilts(setting, used, &facts.coverage);
  }
  if (const auto fault = FaultIn(fit, facts, views.size(), options)) {
    facts.fault = *fault;
    return Failure{facts};
  }
  CameraCalibration found;
  found.camera = fit->camera;
  found.residual_px = facts.residual_px;
  found.covariance = facts.residual_px * facts.residual_px * fit->cofactor;
  found.dof = dof;
  found.pictures = PicturesOf(setting, used, *fit);
  found.coverage = facts.coverage;
  return found;
}

}  // namespace tbm
