#include "pose/rig/camera_section.h"

#include <fmt/format.h>

namespace tbm {
namespace {

void ReadDistortionModel(const YamlNode& camera) {
  // OpenCV's own files have no such key; with four or five coefficients they mean the same model.
  const YamlNode node = camera.Optional("distortion_model");
  const auto model = node.Text();
  if (model && *model != "plumb_bob") {
    node.Fault("must be plumb_bob (k1 k2 p1 p2 k3); calibrate again with that model");
  }
}

bool HasShape(const YamlNode& matrix, std::string_view name, int low, int high) {
  const YamlNode node = matrix.Optional(name);
  return !node.exists() || node.Integer(low, high).has_value();
}

bool IsInside(const YamlNode& node, std::string_view name, double value_px, int size_px) {
  if (size_px <= 0 || (value_px >= 0.0 && value_px <= size_px)) return true;
  node.Fault(
      fmt::format("the principal point {} = {} px lies outside the image; allowed is 0 .. {} px",
                  name,
                  value_px,
                  size_px));
  return false;
}

bool ReadMatrix(const YamlNode& matrix, const KnownKeys& known, CameraModel* model) {
  if (!matrix.IsMap()) return false;
  known(matrix, {"rows", "cols", "data", "dt"});
  bool is_good = HasShape(matrix, "rows", 3, 3);
  is_good = HasShape(matrix, "cols", 3, 3) && is_good;
  const YamlNode data = matrix.Required("data", "nine numbers: fx 0 cx 0 fy cy 0 0 1");
  const auto k = data.Numbers(9, {-1e6, 1e6, "px"});
  if (!k) return false;
  model->fx_px = (*k)[0];
  model->cx_px = (*k)[2];
  model->fy_px = (*k)[4];
  model->cy_px = (*k)[5];
  const bool has_pattern =
      (*k)[1] == 0.0 && (*k)[3] == 0.0 && (*k)[6] == 0.0 && (*k)[7] == 0.0 && (*k)[8] == 1.0;
  if (!has_pattern)
    data.Fault("must have the form fx 0 cx 0 fy cy 0 0 1, row by row, without skew");
  const auto items = data.Items();
  if (model->fx_px <= 1.0) items[0].Fault("the focal length fx must be more than 1 px");
  if (model->fy_px <= 1.0) items[4].Fault("the focal length fy must be more than 1 px");
  is_good = is_good && has_pattern && model->fx_px > 1.0 && model->fy_px > 1.0;
  is_good = IsInside(items[2], "cx", model->cx_px, model->image_width_px) && is_good;
  return IsInside(items[5], "cy", model->cy_px, model->image_height_px) && is_good;
}

bool ReadCoefficients(const YamlNode& matrix, const KnownKeys& known, CameraModel* model) {
  if (!matrix.IsMap()) return false;
  known(matrix, {"rows", "cols", "data", "dt"});
  bool is_good = HasShape(matrix, "rows", 1, 14);
  is_good = HasShape(matrix, "cols", 1, 14) && is_good;
  const YamlNode data = matrix.Required("data", "five numbers: k1 k2 p1 p2 k3");
  if (!data.exists()) return false;
  const std::size_t count = data.IsList() ? data.Items().size() : 0;
  if (count != 4 && count != 5) {
    data.Fault(
        fmt::format("must be a list of k1 k2 p1 p2 k3 (k3 may be missing), has {} items", count));
    return false;
  }
  const auto c = data.Numbers(count, {-1e4, 1e4, ""});
  if (!c) return false;
  model->k1 = (*c)[0];
  model->k2 = (*c)[1];
  model->p1 = (*c)[2];
  model->p2 = (*c)[3];
  model->k3 = count == 5 ? (*c)[4] : 0.0;
  return is_good;
}

// A polynomial that folds back inside the image cannot be undone there: coefficients of another
// lens, or in another order.
bool CanBeInverted(const YamlNode& camera, const CameraModel& model) {
  const double right_px = model.image_width_px - 1.0;
  const double bottom_px = model.image_height_px - 1.0;
  for (const double u_px : {0.0, right_px}) {
    for (const double v_px : {0.0, bottom_px}) {
      if (NormalisedFromPixel(model, {u_px, v_px})) continue;
      camera.Optional("distortion_coefficients")
          .Fault(fmt::format("the lens model cannot be inverted at pixel ({}, {}); the order must "
                             "be k1 k2 p1 p2 k3, and k3 is often better left 0",
                             u_px,
                             v_px));
      return false;
    }
  }
  return true;
}

}  // namespace

bool ReadCameraModel(const YamlNode& camera, const KnownKeys& known, CameraModel* model) {
  if (!camera.IsMap()) return false;
  model->image_width_px = camera.Required("image_width", "pixels of one row, 16 .. 32768")
                              .Integer(16, 32768)
                              .value_or(0);
  model->image_height_px =
      camera.Required("image_height", "rows, 16 .. 32768").Integer(16, 32768).value_or(0);
  ReadDistortionModel(camera);
  const bool has_matrix = ReadMatrix(
      SectionOf(camera, "camera_matrix", "with `data`, nine numbers row by row"), known, model);
  const bool has_lens = ReadCoefficients(
      SectionOf(camera, "distortion_coefficients", "with `data`, k1 k2 p1 p2 k3"), known, model);
  if (!has_matrix || !has_lens || model->image_width_px <= 0 || model->image_height_px <= 0) {
    return false;
  }
  return CanBeInverted(camera, *model);
}

}  // namespace tbm
