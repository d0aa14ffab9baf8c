#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <string>
#include <string_view>

#include "hmi_bridge/server/http_message.h"
#include "pose/base/result.h"

namespace tbm::hmi {

// The built page, read once: what a request asks for is looked up in memory, and no path of it ever
// reaches the file system.
class StaticFiles {
 public:
  // All files below `folder`, which has an index.html. The error is a sentence.
  static Result<StaticFiles, std::string> Read(const std::string& folder);
  StaticFiles() = default;  // none

  // Empty: there is no such file. `path` is compared as it came, nothing is decoded.
  std::optional<Response> Answer(const Request& request) const;
  std::size_t count() const { return files_.size(); }

 private:
  struct File {
    std::string_view content_type;
    std::shared_ptr<const std::string> bytes;
    std::shared_ptr<const std::string> gzipped;  // null where that does not pay
    std::string etag;                            // without quotes
    bool is_immutable = false;                   // its name changes with its bytes
  };

  std::map<std::string, File, std::less<>> files_;
};

// By the ending of a file's name.
std::string_view ContentTypeOf(std::string_view name);
std::string Gzipped(std::string_view bytes);

}  // namespace tbm::hmi
