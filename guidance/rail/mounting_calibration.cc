#include "guidance/rail/mounting_calibration.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <span>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Sparse>
#include <Eigen/SparseCholesky>

#include "guidance/fusion/target_pixels.h"
#include "guidance/rail/rail_filter.h"
#include "pose/geometry/rigid3.h"

namespace tbm {
namespace {

constexpr std::size_t kLeastImages = 10;
constexpr std::size_t kLeastPoints = 4;
// The second puts the nodes where the first has found the exposures.
constexpr int kPasses = 2;
constexpr int kMostRounds = 30;
// Rounds in which a point that is far off only pulls with a bounded force; then it goes.
constexpr int kBoundedRounds = 6;
constexpr double kBound = 3.0;  // sigma
constexpr double kGone = 4.8;   // sigma: one good point in 100 000
constexpr double kFar = 1e9;
constexpr double kSettled = 0.01;  // sigma of what is asked for
constexpr double kMostGone = 0.1;
constexpr double kMostChi2 = 2.0;  // over its degrees of freedom
constexpr double kStill_m_s = 2e-4;
constexpr double kRate_s = 0.05;

constexpr int kNode = 9;  // position, velocity, attitude: the first rows of FusionLayout
constexpr int kShared = 13;
constexpr int kOffset = MountingCalibration::kTimeOffset;
constexpr int kRotation = MountingCalibration::kRotation;
constexpr int kPosition = MountingCalibration::kPosition;

using Sparse = Eigen::SparseMatrix<double>;
using Matrix22 = Eigen::Matrix<double, kNode + kShared, kNode + kShared>;
using Vector22 = Eigen::Matrix<double, kNode + kShared, 1>;
using Vector13 = Eigen::Matrix<double, kShared, 1>;

struct Point {
  int target = 0;
  Eigen::Vector2d pixel_px;
  double sigma_px = 0.0;
  bool is_gone = false;
};

// The unit at the exposure of an image, as far as the offset is known.
struct Node {
  Timestamp at;
  Motion motion;
  Eigen::Vector3d gyro_rad_s = Eigen::Vector3d::Zero();  // the mean of kRate_s around it
  bool rests = false;
  std::vector<Point> points;
};

// Rows of the normal equations, summed up.
class Normal {
 public:
  explicit Normal(Eigen::Index size) : pull_(Eigen::VectorXd::Zero(size)) {}

  // A block of whitened rows: residual = sum of blocks times moves + noise of one.
  struct Block {
    Eigen::Index at = 0;
    Eigen::MatrixXd by;
  };
  void Add(const std::vector<Block>& blocks, const Eigen::VectorXd& residual) {
    for (const Block& one : blocks) {
      AddPull(one.at, one.by.transpose() * residual);
      for (const Block& other : blocks) {
        AddInformation(one.at, other.at, one.by.transpose() * other.by);
      }
    }
    Count(residual.squaredNorm(), static_cast<double>(residual.size()));
  }
  // Products that the caller has summed up himself.
  void AddInformation(Eigen::Index row, Eigen::Index column, const Eigen::MatrixXd& product) {
    for (Eigen::Index i = 0; i < product.rows(); ++i) {
      for (Eigen::Index j = 0; j < product.cols(); ++j) {
        // The solver reads the lower half.
        if (row + i >= column + j) entries_.emplace_back(row + i, column + j, product(i, j));
      }
    }
  }
  void AddPull(Eigen::Index row, const Eigen::VectorXd& pull) {
    pull_.segment(row, pull.size()) += pull;
  }
  void Count(double chi2, double rows) {
    chi2_ += chi2;
    rows_ += rows;
  }

  Sparse Matrix() const {
    Sparse matrix(pull_.size(), pull_.size());
    matrix.setFromTriplets(entries_.begin(), entries_.end());
    return matrix;
  }
  const Eigen::VectorXd& pull() const { return pull_; }
  double chi2() const { return chi2_; }
  double dof() const { return rows_ - static_cast<double>(pull_.size()); }

 private:
  std::vector<Eigen::Triplet<double>> entries_;
  Eigen::VectorXd pull_;
  double chi2_ = 0.0;
  double rows_ = 0.0;
};

class Batch {
 public:
  Batch(const RailSetup& setup, const RailRecording& recording, const MountingLimits& limits)
      : setup_(setup),
        recording_(recording),
        limits_(limits),
        layout_({FusionOption::kTimeOffset,
                 FusionOption::kCameraRotation,
                 FusionOption::kCameraPosition}),
        targets_(recording.targets) {
    const RailCamera& camera = *setup.camera;
    shared_.camera_from_imu = camera.camera_from_imu;
    shared_.camera_in_imu_m = camera.in_imu_m;
    shared_.time_offset_s = camera.time_offset_s;
    first_ = shared_;
  }

  // Begins from a better guess than the set-up's, which stays what the prior is about.
  void BeginFrom(const FusionState& guess) { shared_ = guess; }

  // Where the unit was at each image, one after the other, with the camera as it is guessed.
  bool Begin(const Eigen::Quaterniond& attitude, const RestSignature& rest) {
    shared_.gyro_bias_rad_s = rest.mean_gyro_rad_s;
    exposed_after_stamp_s_ = -shared_.time_offset_s;
    Motion motion;
    motion.position_world_m = setup_.start.position_world_m;
    motion.world_from_imu = attitude;
    const Timestamp begin = BeginOfRun(recording_.imu.front());
    for (const TargetImage& image : recording_.images) {
      if (image.pixels.size() < kLeastPoints) continue;
      const Timestamp at = image.stamped_at + Duration(std::llround(1e9 * exposed_after_stamp_s_));
      if (at < begin || recording_.imu.back().ends_at < at) continue;
      Node node{at, motion, RateAround(at), false, {}};
      node.rests = SecondsBetween(begin, node.at) <= setup_.start.at_rest_s;
      for (const TargetPixel& pixel : image.pixels) {
        node.points.push_back(
            {pixel.target, pixel.pixel_px, std::max(setup_.camera->residual_px, pixel.sigma_px)});
      }
      if (!FitPose(&node)) continue;
      motion = node.motion;
      nodes_.push_back(std::move(node));
    }
    for (std::size_t k = 0; k < nodes_.size(); ++k) {
      const std::size_t before = k > 0 ? k - 1 : k;
      const std::size_t after = std::min(k + 1, nodes_.size() - 1);
      if (nodes_[k].rests || before == after) continue;
      nodes_[k].motion.velocity_world_m_s =
          (nodes_[after].motion.position_world_m - nodes_[before].motion.position_world_m) /
          SecondsBetween(nodes_[before].at, nodes_[after].at);
    }
    return nodes_.size() >= kLeastImages && nodes_.front().rests;
  }

  // One round: everything linear about where it is now. False: the equations cannot be solved.
  bool Round(int round) {
    Normal normal(Size());
    for (std::size_t k = 0; k + 1 < nodes_.size(); ++k) AddWay(k, &normal);
    for (std::size_t k = 0; k < nodes_.size(); ++k) AddImage(k, round, &normal);
    AddRest(&normal);
    AddPriors(&normal);
    const Sparse matrix = normal.Matrix();
    const Eigen::SimplicialLDLT<Sparse> solver(matrix);
    if (solver.info() != Eigen::Success) return false;
    const Eigen::VectorXd move = solver.solve(normal.pull());
    if (!move.allFinite()) return false;
    Eigen::MatrixXd unit = Eigen::MatrixXd::Zero(Size(), kShared);
    for (int i = 0; i < kShared; ++i) unit(SharedAt() + i, i) = 1.0;
    const Eigen::MatrixXd columns = solver.solve(unit);
    covariance_ = columns.middleRows<kShared>(SharedAt());
    chi2_ = normal.chi2();
    dof_ = normal.dof();
    moved_ =
        (move.segment<kShared>(SharedAt()).array() / covariance_.diagonal().cwiseSqrt().array())
            .abs()
            .maxCoeff();
    Move(move);
    return true;
  }

  const FusionState& shared() const { return shared_; }
  const Eigen::Matrix<double, kShared, kShared>& covariance() const { return covariance_; }
  double moved() const { return moved_; }  // largest, of its sigma
  double chi2() const { return chi2_; }
  double dof() const { return dof_; }
  std::size_t images() const { return nodes_.size(); }
  std::size_t Points(bool gone_only) const {
    std::size_t count = 0;
    for (const Node& node : nodes_) {
      count += static_cast<std::size_t>(std::ranges::count_if(
          node.points, [&](const Point& point) { return !gone_only || point.is_gone; }));
    }
    return count;
  }

 private:
  Eigen::Index SharedAt() const { return kNode * static_cast<Eigen::Index>(nodes_.size()); }
  Eigen::Index TargetAt(int target) const { return SharedAt() + kShared + 3 * target; }
  Eigen::Index Size() const { return TargetAt(static_cast<int>(targets_.size())); }

  // What turns the unit at an exposure says how the offset of the clocks moves its image. Of one
  // sample alone the noise is in the way to the image as well, and would be taken for an offset:
  // around it, as much before as behind.
  Eigen::Vector3d RateAround(Timestamp at) const {
    const Duration half = Duration(std::llround(0.5e9 * kRate_s));
    Eigen::Vector3d sum_rad = Eigen::Vector3d::Zero();
    double whole_s = 0.0;
    for (auto sample = std::ranges::upper_bound(recording_.imu, at - half, {}, &ImuSample::ends_at);
         sample != recording_.imu.end() && BeginOfRun(*sample) < at + half;
         ++sample) {
      const double span_s = SecondsBetween(std::max(BeginOfRun(*sample), at - half),
                                           std::min(sample->ends_at, at + half));
      sum_rad += span_s * sample->gyro_rad_s;
      whole_s += span_s;
    }
    return sum_rad / whole_s;
  }

  FusionState StateAt(const Node& node) const {
    FusionState state = shared_;
    state.motion = node.motion;
    state.time_offset_s += exposed_after_stamp_s_;
    return state;
  }

  Result<PixelPrediction, CameraModelFailure> PredictionOf(const Node& node,
                                                           const Point& point) const {
    return PredictPixel(
        {layout_, setup_.camera->model, node.gyro_rad_s - shared_.gyro_bias_rad_s, !node.rests},
        StateAt(node),
        targets_[static_cast<std::size_t>(point.target)]);
  }

  // The pose alone, by its own points; bounded against wrong ones.
  bool FitPose(Node* node) const {
    using Matrix6 = Eigen::Matrix<double, 6, 6>;
    using Vector6 = Eigen::Matrix<double, 6, 1>;
    for (int round = 0; round < 20; ++round) {
      Matrix6 information = 1e-6 * Matrix6::Identity();
      Vector6 pull = Vector6::Zero();
      for (const Point& point : node->points) {
        const auto prediction = PredictionOf(*node, point);
        if (!prediction) return false;
        Eigen::Matrix<double, 2, 6> by;
        by << prediction->by_error.middleCols<3>(FusionLayout::kPosition),
            prediction->by_error.middleCols<3>(FusionLayout::kAttitude);
        const Eigen::Vector2d off_px = point.pixel_px - prediction->pixel_px;
        const double weight = std::min(1.0, 10.0 / std::max(off_px.norm(), 1e-9));
        information += weight * by.transpose() * by;
        pull += weight * by.transpose() * off_px;
      }
      const Vector6 move = information.ldlt().solve(pull);
      if (!move.allFinite()) return false;
      node->motion.position_world_m += move.head<3>();
      node->motion.world_from_imu =
          (node->motion.world_from_imu * ExpRotation(move.tail<3>())).normalized();
      if (move.norm() < 1e-8) break;
    }
    return true;
  }

  // What the unit says of the way from a node to the next.
  void AddWay(std::size_t k, Normal* normal) const {
    FusionFilter filter(FusionLayout{},
                        StateAt(nodes_[k]),
                        FusionMatrix::Zero(FusionLayout::kCore, FusionLayout::kCore),
                        setup_.imu.noise,
                        setup_.gravity_m_s2,
                        nodes_[k].at);
    auto sample = std::ranges::upper_bound(recording_.imu, nodes_[k].at, {}, &ImuSample::ends_at);
    while (filter.now() < nodes_[k + 1].at && sample != recording_.imu.end()) {
      const double gap_s = sample != recording_.imu.begin()
                               ? GapBefore(setup_, (sample - 1)->ends_at, *sample)
                               : 0.0;
      FeedUpTo(filter, setup_, *sample, std::min(sample->ends_at, nodes_[k + 1].at), gap_s);
      ++sample;
    }
    filter.BringForward();
    FusionMatrix by = FusionMatrix::Identity(FusionLayout::kCore, FusionLayout::kCore);
    filter.last_step().Take(by);
    const FusionVector off = ErrorFrom(filter.state(), StateAt(nodes_[k + 1]), FusionLayout{});
    const Eigen::Matrix<double, kNode, kNode> spread = filter.covariance().topLeftCorner<9, 9>();
    const Eigen::LLT<Eigen::Matrix<double, kNode, kNode>> root(spread);
    const auto whiten = [&](const Eigen::MatrixXd& rows) -> Eigen::MatrixXd {
      return root.matrixL().solve(rows);
    };
    const auto at = static_cast<Eigen::Index>(kNode * k);
    normal->Add({{at, whiten(by.topLeftCorner<9, 9>())},
                 {at + kNode, whiten(-Eigen::MatrixXd::Identity(9, 9))},
                 {SharedAt(), whiten(by.block<9, 6>(0, FusionLayout::kGyroBias))}},
                whiten(off.head<9>()));
  }

  void AddImage(std::size_t k, int round, Normal* normal) {
    Node& node = nodes_[k];
    const auto at = static_cast<Eigen::Index>(kNode * k);
    Matrix22 information = Matrix22::Zero();
    Vector22 pull = Vector22::Zero();
    for (Point& point : node.points) {
      const auto prediction = PredictionOf(node, point);
      const Eigen::Vector2d off =
          prediction ? Eigen::Vector2d((point.pixel_px - prediction->pixel_px) / point.sigma_px)
                     : Eigen::Vector2d::Constant(kFar);
      point.is_gone = !prediction || (round >= kBoundedRounds && off.norm() > kGone);
      if (point.is_gone) continue;
      const double bounded = std::min(1.0, kBound / std::max(off.norm(), 1e-9));
      const double weight = round < kBoundedRounds ? bounded : 1.0;
      const Eigen::Matrix<double, 2, 22> by = prediction->by_error / point.sigma_px;
      const Eigen::Matrix<double, 2, 3> by_target = prediction->by_target_px_per_m / point.sigma_px;
      information += weight * by.transpose() * by;
      pull += weight * by.transpose() * off;
      const Eigen::Matrix<double, 3, 22> cross = weight * by_target.transpose() * by;
      const Eigen::Index target = TargetAt(point.target);
      normal->AddInformation(target, at, cross.leftCols<kNode>());
      normal->AddInformation(target, SharedAt(), cross.rightCols<kShared>());
      normal->AddInformation(target, target, weight * by_target.transpose() * by_target);
      normal->AddPull(target, weight * by_target.transpose() * off);
      normal->Count(weight * off.squaredNorm(), 2.0);
    }
    normal->AddInformation(at, at, information.topLeftCorner<kNode, kNode>());
    normal->AddInformation(SharedAt(), at, information.bottomLeftCorner<kShared, kNode>());
    normal->AddInformation(
        SharedAt(), SharedAt(), information.bottomRightCorner<kShared, kShared>());
    normal->AddPull(at, pull.head<kNode>());
    normal->AddPull(SharedAt(), pull.tail<kShared>());
  }

  void AddRest(Normal* normal) const {
    for (std::size_t k = 0; k < nodes_.size(); ++k) {
      if (!nodes_[k].rests) continue;
      const auto at = static_cast<Eigen::Index>(kNode * k) + FusionLayout::kVelocity;
      normal->Add({{at, Eigen::Matrix3d::Identity() / kStill_m_s}},
                  -nodes_[k].motion.velocity_world_m_s / kStill_m_s);
    }
    if (!setup_.tilt) return;
    // The mean of what the inclinometer read meanwhile, at the first node.
    Eigen::Vector2d mean = Eigen::Vector2d::Zero();
    double count = 0.0;
    const Timestamp begin = BeginOfRun(recording_.imu.front());
    for (const TrolleyTilt& tilt : recording_.tilts) {
      if (SecondsBetween(begin, tilt.sensed_at) > setup_.start.at_rest_s) break;
      mean += Eigen::Vector2d(tilt.angles.beta_rad, tilt.angles.gamma_rad);
      count += 1.0;
    }
    if (count == 0.0) return;
    mean /= count;
    const Eigen::Matrix3d housing_from_imu = setup_.tilt->housing_from_imu.toRotationMatrix();
    const Eigen::Vector3d up_in_imu =
        nodes_.front().motion.world_from_imu.conjugate() * Eigen::Vector3d::UnitZ();
    const Eigen::Vector3d up = housing_from_imu * up_in_imu;
    const Eigen::Vector2d predicted(-std::asin(up.x()), std::asin(up.y()));
    Eigen::Matrix<double, 2, 3> by_direction = Eigen::Matrix<double, 2, 3>::Zero();
    by_direction(0, 0) = -1.0 / std::sqrt(1.0 - up.x() * up.x());
    by_direction(1, 1) = 1.0 / std::sqrt(1.0 - up.y() * up.y());
    const double sigma_rad =
        std::hypot(setup_.tilt->sigma_rad / std::sqrt(count), setup_.tilt->sigma_rotation_rad);
    normal->Add(
        {{FusionLayout::kAttitude, by_direction * housing_from_imu * Skew(up_in_imu) / sigma_rad}},
        (mean - predicted) / sigma_rad);
  }

  void AddPriors(Normal* normal) const {
    const RailImu& imu = setup_.imu;
    Vector13 sigma;
    sigma.segment<3>(0).setConstant(std::hypot(imu.gyro_bias_sigma_rad_s, kEarthRate_rad_s));
    sigma.segment<3>(3).setConstant(imu.accel_bias_sigma_m_s2);
    sigma[kOffset] = limits_.first_time_offset_s;
    sigma.segment<3>(kRotation).setConstant(limits_.first_rotation_rad);
    sigma.segment<3>(kPosition).setConstant(limits_.first_position_m);
    Vector13 off;
    off << -shared_.gyro_bias_rad_s, -shared_.accel_bias_m_s2,
        first_.time_offset_s - shared_.time_offset_s,
        LogRotation(first_.camera_from_imu * shared_.camera_from_imu.conjugate()),
        first_.camera_in_imu_m - shared_.camera_in_imu_m;
    normal->Add({{SharedAt(), Eigen::MatrixXd(sigma.cwiseInverse().asDiagonal())}},
                off.cwiseQuotient(sigma));
    const double start_m = std::max(setup_.start.sigma_position_m, 1e-9);
    normal->Add({{FusionLayout::kPosition, Eigen::Matrix3d::Identity() / start_m}},
                (setup_.start.position_world_m - nodes_.front().motion.position_world_m) / start_m);
    for (std::size_t i = 0; i < targets_.size(); ++i) {
      const double sigma_m = std::max(recording_.targets[i].sigma_m, 1e-9);
      normal->Add({{TargetAt(static_cast<int>(i)), Eigen::Matrix3d::Identity() / sigma_m}},
                  (recording_.targets[i].in_world_m - targets_[i].in_world_m) / sigma_m);
    }
  }

  void Move(const Eigen::VectorXd& move) {
    for (std::size_t k = 0; k < nodes_.size(); ++k) {
      Motion& motion = nodes_[k].motion;
      const Eigen::Matrix<double, 9, 1> own = move.segment<9>(static_cast<Eigen::Index>(kNode * k));
      motion.position_world_m += own.segment<3>(FusionLayout::kPosition);
      motion.velocity_world_m_s += own.segment<3>(FusionLayout::kVelocity);
      motion.world_from_imu =
          (motion.world_from_imu * ExpRotation(own.segment<3>(FusionLayout::kAttitude)))
              .normalized();
    }
    const Vector13 shared = move.segment<kShared>(SharedAt());
    shared_.gyro_bias_rad_s += shared.segment<3>(0);
    shared_.accel_bias_m_s2 += shared.segment<3>(3);
    shared_.time_offset_s += shared[kOffset];
    shared_.camera_from_imu =
        (ExpRotation(shared.segment<3>(kRotation)) * shared_.camera_from_imu).normalized();
    shared_.camera_in_imu_m += shared.segment<3>(kPosition);
    for (std::size_t i = 0; i < targets_.size(); ++i) {
      targets_[i].in_world_m += move.segment<3>(TargetAt(static_cast<int>(i)));
    }
  }

  const RailSetup& setup_;
  const RailRecording& recording_;
  const MountingLimits& limits_;
  const FusionLayout layout_;
  std::vector<SurveyedTarget> targets_;  // as they are found
  std::vector<Node> nodes_;
  FusionState shared_;  // all but its motion
  // Of the nodes: by the offset as it was guessed at the beginning. What is left of it is carried
  // by the rate of one sample, and with its noise.
  double exposed_after_stamp_s_ = 0.0;
  FusionState first_;
  Eigen::Matrix<double, kShared, kShared> covariance_;
  double moved_ = 0.0;
  double chi2_ = 0.0;
  double dof_ = 0.0;
};

std::vector<MountingWeakness> WeakOf(const Eigen::Matrix<double, kShared, kShared>& covariance,
                                     const MountingLimits& limits) {
  const Vector13 sigma = covariance.diagonal().cwiseSqrt();
  std::vector<MountingWeakness> weak;
  if (!(sigma[kOffset] <= limits.most_sigma_time_offset_s)) {
    weak.push_back(MountingWeakness::kTimeOffset);
  }
  if (!(sigma.segment<3>(kRotation).maxCoeff() <= limits.most_sigma_rotation_rad)) {
    weak.push_back(MountingWeakness::kRotation);
  }
  if (!(sigma.segment<3>(kPosition).maxCoeff() <= limits.most_sigma_position_m)) {
    weak.push_back(MountingWeakness::kPosition);
  }
  return weak;
}

Failure<MountingFailure> Fail(MountingFault fault) {
  return {MountingFailure{.fault = fault, .start = {}, .weak = {}}};
}
Failure<MountingFailure> Fail(const RailStartFailure& start) {
  return {MountingFailure{.fault = MountingFault::kStart, .start = start, .weak = {}}};
}

}  // namespace

const char* MissingMotion(MountingWeakness weakness) {
  switch (weakness) {
    case MountingWeakness::kTimeOffset:
      return "drive or turn the trolley while targets are seen";
    case MountingWeakness::kRotation:
      return "let it see targets in depth, or drive along the view, and read the inclinometer";
    case MountingWeakness::kPosition:
      return "turn it about two axes, by some degrees, while targets are seen";
  }
  return "";
}

Result<MountingCalibration, MountingFailure> CalibrateMounting(const RailSetup& setup,
                                                               const RailRecording& recording,
                                                               const MountingLimits& limits) {
  if (!setup.camera) return Fail(MountingFault::kNoCamera);
  const auto rest = FindRestSignature(setup, recording);
  if (!rest) return Fail(rest.error());
  RailSetup guessed = setup;
  guessed.camera->sigma_rotation_rad = limits.first_rotation_rad;
  guessed.camera->sigma_position_m = limits.first_position_m;
  const auto attitude = FindStartAttitude(guessed, recording, *rest);
  if (!attitude) return Fail(attitude.error());
  std::optional<Batch> batch;
  int rounds = 0;
  for (int pass = 0; pass < kPasses; ++pass) {
    std::optional<FusionState> found;
    if (batch) found = batch->shared();
    batch.emplace(setup, recording, limits);
    if (found) batch->BeginFrom(*found);
    if (!batch->Begin(*attitude, *rest)) return Fail(MountingFault::kTooFewImages);
    for (int round = 0;
         round < kMostRounds && (round <= kBoundedRounds + 1 || batch->moved() > kSettled);
         ++round, ++rounds) {
      if (!batch->Round(round)) return Fail(MountingFault::kDoesNotSettle);
    }
  }
  const auto gone = static_cast<double>(batch->Points(true));
  const double chi2_per_dof = batch->chi2() / batch->dof();
  if (gone > kMostGone * static_cast<double>(batch->Points(false)) || chi2_per_dof > kMostChi2) {
    auto failure = Fail(MountingFault::kDoesNotFit);
    failure.error.chi2_per_dof = chi2_per_dof;
    return failure;
  }
  if (batch->moved() > kSettled) return Fail(MountingFault::kDoesNotSettle);
  // As good as what is left over says, where that is more than chance.
  const Eigen::Matrix<double, kShared, kShared> covariance =
      std::max(1.0, chi2_per_dof) * batch->covariance();
  if (auto weak = WeakOf(covariance, limits); !weak.empty()) {
    auto failure = Fail(MountingFault::kDegenerate);
    failure.error.weak = std::move(weak);
    return failure;
  }
  MountingCalibration result;
  const FusionState& shared = batch->shared();
  result.camera_from_imu = shared.camera_from_imu;
  result.camera_in_imu_m = shared.camera_in_imu_m;
  result.time_offset_s = shared.time_offset_s;
  result.gyro_bias_rad_s = shared.gyro_bias_rad_s;
  result.accel_bias_m_s2 = shared.accel_bias_m_s2;
  result.covariance = covariance;
  result.rounds = rounds;
  result.images = batch->images();
  result.points = batch->Points(false);
  result.points_left_out = batch->Points(true);
  result.chi2 = batch->chi2();
  result.dof = batch->dof();
  return result;
}

}  // namespace tbm
