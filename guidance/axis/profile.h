#pragma once

#include <optional>
#include <vector>

#include "guidance/axis/axis_description.h"
#include "guidance/axis/axis_remark.h"

namespace tbm {

struct ProfileState {
  double up_m = 0.0;
  double gradient = 0.0;            // height per plan length, + uphill
  double curvature_up_per_m = 0.0;  // derivative of the gradient by plan length; + in a sag
};

// Heights over internal chainage: straight gradients, parabolas, circles and, for a table, cubics.
class Profile {
 public:
  Profile() = default;  // knows no height anywhere

  // What is odd goes to `remarks`. Nothing when any of it is refused.
  static std::optional<Profile> Build(const std::vector<ProfileElement>& elements,
                                      AxisRemarks* remarks);

  // A cubic spline through heights at increasing chainages, two or more.
  static Profile Through(const std::vector<double>& chainages_m, const std::vector<double>& up_m);

  bool exists() const { return !pieces_.empty(); }
  InternalChainage start() const;
  InternalChainage end() const { return end_; }

  // Empty outside start .. end.
  std::optional<ProfileState> At(InternalChainage chainage) const;

 private:
  // For a cubic: up = up_m + u (gradient + u (b + u c)), u from the start of the piece.
  // For a circle: w0 is the chainage of the start from the centre.
  struct Piece {
    double start_m = 0.0;
    double up_m = 0.0;
    double gradient = 0.0;
    double b_per_m = 0.0;
    double c_per_m2 = 0.0;
    double radius_m = 0.0;  // + sag, - crest, 0 cubic
    double w0_m = 0.0;
  };

  static ProfileState StateOn(const Piece& piece, double chainage_m);
  void AddLine(double start_m, double up_m, double gradient);
  void AddParabola(
      double start_m, double up_m, double gradient, double end_gradient, double length_m);

  std::vector<Piece> pieces_;
  InternalChainage end_;
};

}  // namespace tbm
