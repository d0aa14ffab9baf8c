#include "guidance/axis/profile.h"

#include <algorithm>
#include <cmath>

#include "guidance/axis/cubic_spline.h"

namespace tbm {
namespace {

// How far a rounding reaches before and behind its point, along the plan.
struct Reach {
  double before_m = 0.0;
  double behind_m = 0.0;
};

struct Vertex {
  const ProfileElement* element;
  double gradient_in = 0.0;
  double gradient_out = 0.0;
  Reach reach;
};

constexpr double kLargest_m = 1e8;
// A gradient that jumps by 0.05 per mille is a kink that a track would show.
constexpr double kKinkOddAbove = 5e-5;
// Files round stations to a millimetre.
constexpr double kTouch_m = 0.001;

AxisRemark Remark(AxisRemarkCode code,
                  Severity severity,
                  const ProfileElement& element,
                  double size) {
  return RemarkAt(code, severity, element.line, element.at, size);
}

bool IsFinite(const ProfileElement& e) {
  for (const double value : {e.at.m, e.up_m, e.length_in_m, e.length_out_m, e.radius_m}) {
    if (!(std::abs(value) < kLargest_m)) return false;
  }
  return e.length_in_m >= 0.0 && e.length_out_m >= 0.0;
}

bool IsRounded(const ProfileElement& element) {
  switch (element.kind) {
    case ProfileKind::kPoint:
      return false;
    case ProfileKind::kParabola:
      return element.length_in_m > 0.0;
    case ProfileKind::kUnequalParabolas:
      return element.length_in_m > 0.0 && element.length_out_m > 0.0;
    case ProfileKind::kCircle:
      return true;
  }
  return false;
}

// The circle that touches both gradients: its tangents have the length R tan(half the angle between
// them), measured along the slope.
Reach CircleReach(double radius_m, double gradient_in, double gradient_out) {
  const double in_rad = std::atan(gradient_in);
  const double out_rad = std::atan(gradient_out);
  const double tangent_m = std::abs(radius_m) * std::tan(0.5 * std::abs(out_rad - in_rad));
  return {tangent_m * std::cos(in_rad), tangent_m * std::cos(out_rad)};
}

Reach ReachOf(const ProfileElement& element, double gradient_in, double gradient_out) {
  if (!IsRounded(element)) return {};
  switch (element.kind) {
    case ProfileKind::kParabola:
      return {0.5 * element.length_in_m, 0.5 * element.length_in_m};
    case ProfileKind::kUnequalParabolas:
      return {element.length_in_m, element.length_out_m};
    case ProfileKind::kCircle:
      return CircleReach(element.radius_m, gradient_in, gradient_out);
    case ProfileKind::kPoint:
      break;
  }
  return {};
}

class Checker {
 public:
  Checker(const std::vector<ProfileElement>& elements, AxisRemarks* remarks)
      : elements_(elements), remarks_(*remarks) {}

  // Vertices with their gradients; empty when refused.
  std::vector<Vertex> Vertices() {
    const std::size_t before = remarks_.size();
    for (const ProfileElement& element : elements_) {
      if (!IsFinite(element)) Refuse(AxisRemarkCode::kProfileNotFinite, element, 0.0);
    }
    for (std::size_t i = 1; i < elements_.size(); ++i) {
      const double step_m = elements_[i].at.m - elements_[i - 1].at.m;
      if (!(step_m > 0.0)) Refuse(AxisRemarkCode::kProfileOrder, elements_[i], step_m);
    }
    if (elements_.size() < 2) Refuse(AxisRemarkCode::kProfileOrder, elements_.front(), 0.0);
    if (remarks_.size() != before) return {};
    std::vector<Vertex> vertices = WithGradients();
    for (const Vertex& vertex : vertices) CheckVertex(vertex);
    for (std::size_t i = 1; i < vertices.size(); ++i) CheckRoom(vertices[i - 1], vertices[i]);
    if (is_refused_) return {};
    return vertices;
  }

 private:
  void Refuse(AxisRemarkCode code, const ProfileElement& element, double size) {
    remarks_.push_back(Remark(code, Severity::kRefused, element, size));
    is_refused_ = true;
  }

  std::vector<Vertex> WithGradients() const {
    std::vector<Vertex> vertices;
    for (const ProfileElement& element : elements_) vertices.push_back({&element, 0.0, 0.0, {}});
    for (std::size_t i = 1; i < vertices.size(); ++i) {
      const ProfileElement& from = elements_[i - 1];
      const ProfileElement& to = elements_[i];
      const double gradient = (to.up_m - from.up_m) / (to.at.m - from.at.m);
      vertices[i - 1].gradient_out = gradient;
      vertices[i].gradient_in = gradient;
    }
    vertices.front().gradient_in = vertices.front().gradient_out;
    vertices.back().gradient_out = vertices.back().gradient_in;
    for (Vertex& vertex : vertices) {
      vertex.reach = ReachOf(*vertex.element, vertex.gradient_in, vertex.gradient_out);
    }
    return vertices;
  }

  void CheckVertex(const Vertex& vertex) {
    const ProfileElement& element = *vertex.element;
    const bool is_at_end = &element == &elements_.front() || &element == &elements_.back();
    const double jump = vertex.gradient_out - vertex.gradient_in;
    if (IsRounded(element) && is_at_end) {
      Refuse(AxisRemarkCode::kProfileCurveAtEnd, element, element.length_in_m);
      return;
    }
    if (element.kind == ProfileKind::kCircle) {
      CheckCircle(vertex);
    } else if (!IsRounded(element) && std::abs(jump) > kKinkOddAbove) {
      remarks_.push_back(
          Remark(AxisRemarkCode::kProfileKink, Severity::kOdd, element, std::abs(jump)));
    }
  }

  void CheckCircle(const Vertex& vertex) {
    const ProfileElement& element = *vertex.element;
    const double radius_m = std::abs(element.radius_m);
    if (!(radius_m > 0.0)) {
      Refuse(AxisRemarkCode::kProfileCircle, element, element.radius_m);
      return;
    }
    const double plan_m = vertex.reach.before_m + vertex.reach.behind_m;
    const double arc_m =
        radius_m * std::abs(std::atan(vertex.gradient_out) - std::atan(vertex.gradient_in));
    const double off_m =
        std::min(std::abs(element.length_in_m - plan_m), std::abs(element.length_in_m - arc_m));
    if (element.length_in_m > 0.0 && off_m > kGapRefusedAbove_m) {
      AxisRemark remark = Remark(AxisRemarkCode::kProfileLength, Severity::kOdd, element, off_m);
      remark.stated = element.length_in_m;
      remark.computed = plan_m;
      remarks_.push_back(remark);
    }
  }

  void CheckRoom(const Vertex& from, const Vertex& to) {
    const double room_m = to.element->at.m - from.element->at.m;
    const double over_m = from.reach.behind_m + to.reach.before_m - room_m;
    if (over_m > kTouch_m) Refuse(AxisRemarkCode::kProfileOverlap, *to.element, over_m);
  }

  const std::vector<ProfileElement>& elements_;
  AxisRemarks& remarks_;
  bool is_refused_ = false;
};

}  // namespace

void Profile::AddLine(double start_m, double up_m, double gradient) {
  pieces_.push_back({start_m, up_m, gradient, 0.0, 0.0, 0.0, 0.0});
}

void Profile::AddParabola(
    double start_m, double up_m, double gradient, double end_gradient, double length_m) {
  pieces_.push_back(
      {start_m, up_m, gradient, 0.5 * (end_gradient - gradient) / length_m, 0.0, 0.0, 0.0});
}

std::optional<Profile> Profile::Build(const std::vector<ProfileElement>& elements,
                                      AxisRemarks* remarks) {
  if (elements.empty()) return Profile();
  const std::vector<Vertex> vertices = Checker(elements, remarks).Vertices();
  if (vertices.empty()) return std::nullopt;
  Profile profile;
  for (const Vertex& vertex : vertices) {
    const ProfileElement& element = *vertex.element;
    const double in = vertex.gradient_in;
    const double out = vertex.gradient_out;
    const Reach reach = vertex.reach;
    const double start_m = element.at.m - reach.before_m;
    const double up_m = element.up_m - in * reach.before_m;
    // Two roundings may touch, or overlap by the rounding of the file: no straight between them.
    if (IsRounded(element) && profile.pieces_.back().start_m >= start_m) profile.pieces_.pop_back();
    if (element.kind == ProfileKind::kCircle && in != out) {
      const double radius_m = out > in ? std::abs(element.radius_m) : -std::abs(element.radius_m);
      profile.pieces_.push_back(
          {start_m, up_m, in, 0.0, 0.0, radius_m, radius_m * in / std::hypot(1.0, in)});
    } else if (element.kind == ProfileKind::kUnequalParabolas && IsRounded(element)) {
      // Both touch at the point's chainage, at the gradient that the lengths weigh.
      const double whole_m = reach.before_m + reach.behind_m;
      const double middle = (reach.before_m * in + reach.behind_m * out) / whole_m;
      profile.AddParabola(start_m, up_m, in, middle, reach.before_m);
      profile.AddParabola(
          element.at.m, up_m + 0.5 * (in + middle) * reach.before_m, middle, out, reach.behind_m);
    } else if (IsRounded(element)) {
      profile.AddParabola(start_m, up_m, in, out, reach.before_m + reach.behind_m);
    }
    profile.AddLine(element.at.m + reach.behind_m, element.up_m + out * reach.behind_m, out);
  }
  // The line behind the last point has no length; it only marks the end.
  profile.pieces_.pop_back();
  profile.end_ = elements.back().at;
  return profile;
}

Profile Profile::Through(const std::vector<double>& chainages_m, const std::vector<double>& up_m) {
  const CubicSpline spline(chainages_m, up_m);
  Profile profile;
  for (std::size_t i = 0; i < spline.interval_count(); ++i) {
    const CubicSpline::Cubic cubic = spline.On(i);
    profile.pieces_.push_back({chainages_m[i], cubic.a, cubic.b, cubic.c, cubic.d, 0.0, 0.0});
  }
  profile.end_ = {chainages_m.back()};
  return profile;
}

InternalChainage Profile::start() const {
  return {pieces_.empty() ? end_.m : pieces_.front().start_m};
}

ProfileState Profile::StateOn(const Piece& piece, double chainage_m) {
  const double u = chainage_m - piece.start_m;
  if (piece.radius_m == 0.0) {
    return {piece.up_m + u * (piece.gradient + u * (piece.b_per_m + u * piece.c_per_m2)),
            piece.gradient + u * (2.0 * piece.b_per_m + u * 3.0 * piece.c_per_m2),
            2.0 * piece.b_per_m + 6.0 * piece.c_per_m2 * u};
  }
  // With w the chainage from the centre, in a sag the height over the start is
  // sqrt(r^2 - w0^2) - sqrt(r^2 - w^2); written so that no digits are lost. A crest is its mirror.
  const double side = piece.radius_m > 0.0 ? 1.0 : -1.0;
  const double w = piece.w0_m + u;
  const double root0 = std::sqrt(piece.radius_m * piece.radius_m - piece.w0_m * piece.w0_m);
  const double root = std::sqrt(std::max(piece.radius_m * piece.radius_m - w * w, 0.0));
  const double rise = side * (w - piece.w0_m) * (w + piece.w0_m) / (root0 + root);
  return {piece.up_m + rise,
          side * w / root,
          side * piece.radius_m * piece.radius_m / (root * root * root)};
}

std::optional<ProfileState> Profile::At(InternalChainage chainage) const {
  if (pieces_.empty() || chainage < start() || chainage > end_) return std::nullopt;
  const auto next = std::upper_bound(
      pieces_.begin(), pieces_.end(), chainage.m, [](double at_m, const Piece& piece) {
        return at_m < piece.start_m;
      });
  return StateOn(*std::prev(next), chainage.m);
}

}  // namespace tbm
