#include "hmi_bridge/server/static_files.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <utility>

#include <fmt/format.h>
#include <zlib.h>

#include "hmi_bridge/server/secrets.h"
#include "pose/base/check.h"

namespace tbm::hmi {
namespace {

constexpr std::size_t kMostFiles = 1000;
constexpr std::uintmax_t kMostBytes = 64u << 20;
constexpr std::size_t kWorthZipping = 512;
constexpr std::string_view kHashedFolder = "/assets/";

struct ContentType {
  std::string_view ending;
  std::string_view type;
  bool zips = false;
};
constexpr std::array<ContentType, 18> kTypes = {{
    {".html", "text/html; charset=utf-8", true},
    {".js", "text/javascript; charset=utf-8", true},
    {".mjs", "text/javascript; charset=utf-8", true},
    {".css", "text/css; charset=utf-8", true},
    {".json", "application/json", true},
    {".map", "application/json", true},
    {".webmanifest", "application/manifest+json", true},
    {".svg", "image/svg+xml", true},
    {".csv", "text/csv; charset=utf-8", true},
    {".txt", "text/plain; charset=utf-8", true},
    {".png", "image/png", false},
    {".jpg", "image/jpeg", false},
    {".ico", "image/x-icon", false},
    {".webp", "image/webp", false},
    {".woff2", "font/woff2", false},
    {".mp3", "audio/mpeg", false},
    {".ogg", "audio/ogg", false},
    {".wav", "audio/wav", true},
}};

ContentType TypeOf(std::string_view path) {
  for (const ContentType& type : kTypes) {
    if (path.ends_with(type.ending)) return type;
  }
  return {"", "application/octet-stream", false};
}

// The tags of If-None-Match are separated by commas, weak ones begin with W/.
bool Matches(std::string_view if_none_match, std::string_view etag) {
  return if_none_match == "*" || ListHolds(if_none_match, etag) ||
         ListHolds(if_none_match, fmt::format("W/{}", etag));
}

}  // namespace

std::string_view ContentTypeOf(std::string_view name) { return TypeOf(name).type; }

std::string Gzipped(std::string_view bytes) {
  z_stream stream = {};
  constexpr int kGzipWindow = 15 + 16;
  TBM_CHECK(deflateInit2(&stream, 9, Z_DEFLATED, kGzipWindow, 9, Z_DEFAULT_STRATEGY) == Z_OK);
  std::string zipped(deflateBound(&stream, bytes.size()), '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(zipped.data());
  stream.avail_out = static_cast<uInt>(zipped.size());
  TBM_CHECK(deflate(&stream, Z_FINISH) == Z_STREAM_END);
  zipped.resize(stream.total_out);
  deflateEnd(&stream);
  return zipped;
}

Result<StaticFiles, std::string> StaticFiles::Read(const std::string& folder) {
  namespace fs = std::filesystem;
  StaticFiles read;
  std::error_code error;
  std::uintmax_t total = 0;
  fs::recursive_directory_iterator entries(folder, error);
  if (error) return Failure{fmt::format("{}: cannot be read: {}", folder, error.message())};
  for (const auto end = fs::recursive_directory_iterator(); entries != end;
       entries.increment(error)) {
    const auto& entry = *entries;
    // A link could lead anywhere.
    if (entry.is_symlink(error)) {
      return Failure{
          fmt::format("{}: is a link; the page is made of files", entry.path().string())};
    }
    if (!entry.is_regular_file(error)) continue;
    total += entry.file_size(error);
    if (read.files_.size() >= kMostFiles || total > kMostBytes) {
      return Failure{fmt::format("{}: more than {} files or {} MB: this is not the built page",
                                 folder,
                                 kMostFiles,
                                 kMostBytes >> 20)};
    }
    std::ifstream stream(entry.path(), std::ios::binary);
    std::string bytes{std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
    if (error || stream.bad() || !stream.is_open()) {
      return Failure{fmt::format("{}: cannot be read", entry.path().string())};
    }
    const std::string path = "/" + fs::relative(entry.path(), folder, error).generic_string();
    const ContentType type = TypeOf(path);
    File file;
    file.content_type = type.type;
    file.etag = Sha256Hex(bytes).substr(0, 32);
    file.is_immutable = path.starts_with(kHashedFolder);
    if (type.zips && bytes.size() >= kWorthZipping) {
      std::string zipped = Gzipped(bytes);
      if (zipped.size() < bytes.size()) {
        file.gzipped = std::make_shared<const std::string>(std::move(zipped));
      }
    }
    file.bytes = std::make_shared<const std::string>(std::move(bytes));
    read.files_.emplace(path, std::move(file));
  }
  if (error) return Failure{fmt::format("{}: cannot be read: {}", folder, error.message())};
  const auto index = read.files_.find("/index.html");
  if (index == read.files_.end()) {
    return Failure{fmt::format("{}: has no index.html: this is not the built page", folder)};
  }
  read.files_.emplace("/", index->second);
  return read;
}

std::optional<Response> StaticFiles::Answer(const Request& request) const {
  const auto found = files_.find(request.path());
  if (found == files_.end()) return std::nullopt;
  const File& file = found->second;
  const bool is_zipped = file.gzipped != nullptr && TakesGzip(request.accept_encoding);
  const std::string etag = fmt::format("\"{}{}\"", file.etag, is_zipped ? "-gz" : "");
  Response response;
  response.Set("Content-Type", std::string(file.content_type));
  response.Set("ETag", etag);
  response.Set("Cache-Control",
               file.is_immutable ? "public, max-age=31536000, immutable" : "no-cache");
  if (file.gzipped != nullptr) response.Set("Vary", "Accept-Encoding");
  if (Matches(request.if_none_match, etag)) {
    response.status = 304;
    return response;
  }
  if (is_zipped) response.Set("Content-Encoding", "gzip");
  response.body = is_zipped ? file.gzipped : file.bytes;
  return response;
}

}  // namespace tbm::hmi
