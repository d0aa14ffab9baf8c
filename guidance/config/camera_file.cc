#include "guidance/config/camera_file.h"

#include "guidance/config/camera_node.h"
#include "pose/rig/camera_section.h"
#include "pose/rig/yaml_section.h"

namespace tbm {
namespace {

CameraModel Read(const YamlNode& root) {
  CameraModel model;
  ReadCameraModel(
      CameraNodeOf(root), [](const YamlNode&, const std::set<std::string_view>&) {}, &model);
  return model;
}

}  // namespace

YamlNode CameraNodeOf(const YamlNode& root) {
  if (!root.IsMap()) {
    root.Fault("is not a map with `camera:`, or with image_width, camera_matrix, ..");
    return root.Optional("camera");
  }
  const YamlNode inner = root.Optional("camera");
  if (!inner.exists()) return root;
  if (!inner.IsMap())
    inner.Fault("must be a map with image_width, image_height, camera_matrix, ..");
  return inner;
}

Result<CameraModel, RigFileFaults> ParseCameraFile(std::string_view yaml, const std::string& file) {
  return ReadYaml(yaml, file, [](const YamlNode& root) { return Read(root); });
}

Result<CameraModel, RigFileFaults> LoadCameraFile(const std::string& path) {
  const auto text = ReadConfigText(path, "the camera's file");
  if (!text) return Failure{text.error()};
  return ParseCameraFile(*text, path);
}

}  // namespace tbm
