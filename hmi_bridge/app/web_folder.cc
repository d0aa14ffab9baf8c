#include "hmi_bridge/app/web_folder.h"

#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <regex>

namespace tbm::hmi {
namespace {

constexpr std::size_t kMostIndexBytes = 1'000'000;

std::string DefaultFolder() {
  std::error_code ignored;
  const auto program = std::filesystem::read_symlink("/proc/self/exe", ignored);
  const auto installed = program.parent_path().parent_path() / "share/tbm/console";
  return std::filesystem::exists(installed / "index.html", ignored) ? installed.string()
                                                                    : TBM_WEB_FOLDER;
}

}  // namespace

std::string PageBuildOf(std::string_view index_html) {
  static const std::regex meta(R"re(<meta\s+name="page-build"\s+content="([^"]{1,64})")re");
  std::match_results<std::string_view::const_iterator> found;
  if (!std::regex_search(index_html.begin(), index_html.end(), found, meta)) return {};
  return found[1].str();
}

Result<WebFolder, std::string> FindWebFolder(const std::string& configured) {
  const std::string folder = configured.empty() ? DefaultFolder() : configured;
  std::ifstream file(folder + "/index.html", std::ios::binary);
  std::string text(std::istreambuf_iterator<char>(file), {});
  if (!file || text.empty() || text.size() > kMostIndexBytes) {
    return Failure{folder + ": no index.html of the page there; tools/build release makes it"};
  }
  const std::string build = PageBuildOf(text);
  if (build.empty()) {
    return Failure{folder + "/index.html: no <meta name=\"page-build\">; is this the page?"};
  }
  return WebFolder{folder, build};
}

}  // namespace tbm::hmi
