#include "hmi_bridge/server/auth_store.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <utility>

#include <fmt/format.h>

namespace tbm::hmi {
namespace {

constexpr std::string_view kFirstName = "surveyor";
constexpr std::string_view kFirstPasswordFile = "first_password.txt";
constexpr std::size_t kTokenBytes = 32;
constexpr std::size_t kMostUsers = 1000;
constexpr std::int64_t kReadTokenNeverExpires_utc_ms = 253'402'300'799'000;
// A session from further ahead than this was opened under another clock.
constexpr std::int64_t kDay_ms = 24 * 3600 * 1000;

template <class Duration>
std::int64_t Milliseconds(Duration span) {
  return std::chrono::duration_cast<std::chrono::milliseconds>(span).count();
}

std::string Lower(std::string_view text) {
  std::string lower(text);
  for (char& c : lower) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return lower;
}

Result<std::vector<User>, std::string> Parse(const User*,
                                             std::string_view text,
                                             const std::string& file) {
  return ParseUsers(text, file);
}
Result<std::vector<Session>, std::string> Parse(const Session*,
                                                std::string_view text,
                                                const std::string& file) {
  return ParseSessions(text, file);
}
Result<std::vector<ReadToken>, std::string> Parse(const ReadToken*,
                                                  std::string_view text,
                                                  const std::string& file) {
  return ParseReadTokens(text, file);
}

template <class Rows>
auto Named(Rows& rows, std::string_view name) {
  return std::find_if(rows.begin(), rows.end(), [&](const auto& row) { return row.name == name; });
}

std::string NoSuch(const char* what, const std::string& name) {
  return fmt::format("there is no {} '{}'", what, name);
}

std::string NewEdition() { return Hex(RandomBytes(8)); }

}  // namespace

std::optional<std::string> WhyNotPassword(std::string_view name, std::string_view password) {
  constexpr std::size_t kLeast = 12;
  constexpr std::size_t kMost = 256;
  if (password.size() < kLeast) return fmt::format("a password has at least {} characters", kLeast);
  if (password.size() > kMost) return fmt::format("a password has at most {} characters", kMost);
  const std::string lower = Lower(password);
  if (lower.find_first_not_of(lower[0]) == std::string::npos) {
    return "a password is not one character again and again";
  }
  constexpr std::array<std::string_view, 12> kSilly = {"password",
                                                       "passwort",
                                                       "123456",
                                                       "qwert",
                                                       "abcdef",
                                                       "letmein",
                                                       "tunnel",
                                                       "surveyor",
                                                       "operator",
                                                       "guidance",
                                                       "admin",
                                                       "changeme"};
  // What is left of it without such words, the name and digits is what there is to guess.
  std::string rest = lower;
  const auto take_out = [&rest](std::string_view word) {
    for (auto at = rest.find(word); !word.empty() && at != std::string::npos;
         at = rest.find(word)) {
      rest.erase(at, word.size());
    }
  };
  take_out(Lower(name));
  for (const std::string_view word : kSilly) take_out(word);
  const auto is_hard = [](char c) {
    return std::isalpha(static_cast<unsigned char>(c)) != 0 || c < 0;
  };
  if (rest.size() < lower.size() && std::count_if(rest.begin(), rest.end(), is_hard) < 4) {
    return "the password is the name, or one of those that are tried first";
  }
  return std::nullopt;
}

AuthStore::AuthStore(PrivateFolder folder, const Clock& clock, AuthLimits limits)
    : folder_(std::move(folder)),
      clock_(clock),
      limits_(limits),
      nobody_(HashOf(RandomToken(kTokenBytes), limits.log2_n)) {}

Result<std::unique_ptr<AuthStore>, std::string> AuthStore::Open(const std::string& folder,
                                                                const Clock& clock,
                                                                AuthLimits limits) {
  auto opened = PrivateFolder::Open(folder);
  if (!opened) return Failure{opened.error()};
  std::unique_ptr<AuthStore> store(new AuthStore(std::move(opened).value(), clock, limits));
  const std::lock_guard lock(store->mutex_);
  auto users = store->Read(store->users_);
  auto sessions = store->Read(store->sessions_);
  auto tokens = store->Read(store->tokens_);
  if (!users) return Failure{users.error()};
  if (!sessions) return Failure{sessions.error()};
  if (!tokens) return Failure{tokens.error()};
  store->Take(store->users_, std::move(users).value());
  store->Take(store->sessions_, std::move(sessions).value());
  store->Take(store->tokens_, std::move(tokens).value());
  store->looked_at_ = clock.Steady();
  store->uses_kept_utc_ms_ = store->Now_utc_ms();
  return store;
}

std::int64_t AuthStore::Now_utc_ms() const { return clock_.Now().ns / 1'000'000; }

template <class Entry>
Result<AuthStore::Rows<Entry>, std::string> AuthStore::Read(const File<Entry>& file) const {
  auto content = folder_.Read(file.name);
  if (!content) return Failure{content.error()};
  if (!content->has_value()) return Rows<Entry>{};
  auto rows =
      Parse(static_cast<const Entry*>(nullptr), (*content)->text, folder_.PathOf(file.name));
  if (!rows) return Failure{rows.error()};
  return Rows<Entry>{std::move(rows).value(), (*content)->stamp};
}

template <class Entry>
void AuthStore::Take(File<Entry>& file, Rows<Entry> read) {
  if constexpr (std::is_same_v<Entry, Session>) TakeNewestUses(read.rows);
  file.rows = std::move(read.rows);
  file.stamp = read.stamp;
}

template <class Entry, class Change>
std::optional<std::string> AuthStore::Alter(File<Entry>& file, Change change) {
  const std::lock_guard one_at_a_time(changing_);
  const PrivateFolder::Lock held(folder_);
  if (!held.is_held()) return folder_.path() + ": cannot be locked";
  auto read = Read(file);
  if (!read) return read.error();
  Rows<Entry> next = std::move(read).value();
  {
    const std::lock_guard lock(mutex_);
    if constexpr (std::is_same_v<Entry, Session>) TakeNewestUses(next.rows);
    if (std::optional<std::string> fault = change(next.rows)) return fault;
  }
  if (auto fault = folder_.Write(file.name, TextOf(next.rows))) return fault;
  next.stamp = folder_.StampOf(file.name);
  const std::lock_guard lock(mutex_);
  Take(file, std::move(next));
  return std::nullopt;
}

template <class Entry>
void AuthStore::LookAt(File<Entry>& file) {
  const FileStamp stamp = folder_.StampOf(file.name);
  if (stamp == file.stamp || (stamp.exists && stamp == file.refused)) return;
  auto read = Read(file);
  if (read) return Take(file, std::move(read).value());
  file.refused = stamp;
  if (faults_.size() < 16) faults_.push_back(read.error());
}

void AuthStore::Look() {
  const auto now = clock_.Steady();
  if (now - looked_at_ < limits_.look_every) return;
  looked_at_ = now;
  LookAt(users_);
  LookAt(sessions_);
  LookAt(tokens_);
}

Result<std::optional<FirstUser>, std::string> AuthStore::MakeFirstUser() {
  {
    const std::lock_guard lock(mutex_);
    if (!users_.rows.empty()) return std::optional<FirstUser>();
  }
  FirstUser first{std::string(kFirstName), RandomPassword(), folder_.PathOf(kFirstPasswordFile)};
  // First the password, then the user: the other way round a power cut between the two would leave
  // a user whom nobody can be.
  if (auto fault = folder_.Write(kFirstPasswordFile, first.password + "\n")) return Failure{*fault};
  const User user{
      first.name, Role::kSurveyor, NewEdition(), HashOf(first.password, limits_.log2_n)};
  const auto fault = Alter(users_, [&](std::vector<User>& users) -> std::optional<std::string> {
    if (!users.empty()) return "another process has just made the first user";
    users.push_back(user);
    return std::nullopt;
  });
  if (fault) return Failure{*fault};
  return std::optional<FirstUser>(std::move(first));
}

std::optional<std::string> AuthStore::AddUser(const std::string& name,
                                              Role role,
                                              std::string_view password) {
  if (!IsName(name)) return "a name has 1 to 32 letters, digits, '.', '_' or '-'";
  if (auto fault = WhyNotPassword(name, password)) return fault;
  const User user{name, role, NewEdition(), HashOf(password, limits_.log2_n)};
  return Alter(users_, [&](std::vector<User>& users) -> std::optional<std::string> {
    if (Named(users, name) != users.end()) return fmt::format("user '{}' is there already", name);
    if (users.size() >= kMostUsers) return fmt::format("there are {} users already", kMostUsers);
    users.push_back(user);
    return std::nullopt;
  });
}

std::optional<std::string> AuthStore::SetPassword(const std::string& name,
                                                  std::string_view password) {
  if (auto fault = WhyNotPassword(name, password)) return fault;
  const PasswordHash hash = HashOf(password, limits_.log2_n);
  auto fault = Alter(users_, [&](std::vector<User>& users) -> std::optional<std::string> {
    const auto user = Named(users, name);
    if (user == users.end()) return NoSuch("user", name);
    user->password = hash;
    user->edition = NewEdition();
    return std::nullopt;
  });
  if (!fault) ForgetFirstPassword(name);
  return fault;
}

std::optional<std::string> AuthStore::SetRole(const std::string& name, Role role) {
  return Alter(users_, [&](std::vector<User>& users) -> std::optional<std::string> {
    const auto user = Named(users, name);
    if (user == users.end()) return NoSuch("user", name);
    user->role = role;
    user->edition = NewEdition();
    return std::nullopt;
  });
}

std::optional<std::string> AuthStore::RemoveUser(const std::string& name) {
  auto fault = Alter(users_, [&](std::vector<User>& users) -> std::optional<std::string> {
    const auto user = Named(users, name);
    if (user == users.end()) return NoSuch("user", name);
    // Without any user the next start would make the first one anew.
    if (users.size() == 1) return fmt::format("'{}' is the last user: add another one first", name);
    users.erase(user);
    return std::nullopt;
  });
  if (!fault) ForgetFirstPassword(name);
  return fault;
}

void AuthStore::ForgetFirstPassword(const std::string& name) {
  // It opens nothing any more: that it cannot be removed is no reason to refuse the change.
  if (name == kFirstName) folder_.Remove(kFirstPasswordFile);
}

std::vector<AuthStore::ListedUser> AuthStore::ListUsers() {
  const std::lock_guard lock(mutex_);
  LookAt(users_);
  LookAt(sessions_);
  std::vector<Session> open = sessions_.rows;
  DropWorthless(open);
  std::vector<ListedUser> list;
  for (const User& user : users_.rows) {
    const auto count = std::count_if(open.begin(), open.end(), [&](const Session& session) {
      return session.user == user.name;
    });
    list.push_back({user.name, user.role, static_cast<std::size_t>(count)});
  }
  return list;
}

Result<std::string, std::string> AuthStore::AddToken(const std::string& name) {
  if (!IsName(name)) {
    return Failure{std::string("a name has 1 to 32 letters, digits, '.', '_' or '-'")};
  }
  const std::string token = RandomToken(kTokenBytes);
  const auto fault =
      Alter(tokens_, [&](std::vector<ReadToken>& tokens) -> std::optional<std::string> {
        if (Named(tokens, name) != tokens.end())
          return fmt::format("token '{}' is there already", name);
        if (tokens.size() >= kMostUsers)
          return fmt::format("there are {} tokens already", kMostUsers);
        tokens.push_back({Sha256Hex(token), name, Now_utc_ms()});
        return std::nullopt;
      });
  if (fault) return Failure{*fault};
  return token;
}

std::optional<std::string> AuthStore::RemoveToken(const std::string& name) {
  return Alter(tokens_, [&](std::vector<ReadToken>& tokens) -> std::optional<std::string> {
    const auto token = Named(tokens, name);
    if (token == tokens.end()) return NoSuch("token", name);
    tokens.erase(token);
    return std::nullopt;
  });
}

std::vector<ReadToken> AuthStore::ListTokens() {
  const std::lock_guard lock(mutex_);
  LookAt(tokens_);
  return tokens_.rows;
}

const User* AuthStore::FindUser(std::string_view name) const {
  const auto found = Named(users_.rows, name);
  return found == users_.rows.end() ? nullptr : &*found;
}

std::int64_t AuthStore::ExpiresAt(const Session& session) const {
  return std::min(session.used_utc_ms + Milliseconds(limits_.unused),
                  session.created_utc_ms + Milliseconds(limits_.longest));
}

// The user of a session that is worth something; null otherwise.
const User* AuthStore::UserOf(const Session& session) const {
  const std::int64_t now = Now_utc_ms();
  if (now >= ExpiresAt(session) || session.created_utc_ms > now + kDay_ms) return nullptr;
  const User* user = FindUser(session.user);
  return user != nullptr && user->edition == session.edition ? user : nullptr;
}

Session* AuthStore::FindSession(std::string_view token_sha256) {
  for (Session& session : sessions_.rows) {
    if (session.token_sha256 == token_sha256) return &session;
  }
  return nullptr;
}

void AuthStore::TakeNewestUses(std::vector<Session>& rows) const {
  for (Session& row : rows) {
    for (const Session& held : sessions_.rows) {
      if (held.token_sha256 == row.token_sha256) {
        row.used_utc_ms = std::max(row.used_utc_ms, held.used_utc_ms);
      }
    }
  }
}

void AuthStore::DropWorthless(std::vector<Session>& rows) const {
  // One of tomorrow stays: its day may come when the clock is put right.
  const std::int64_t now = Now_utc_ms();
  std::erase_if(rows, [&](const Session& row) {
    const User* user = FindUser(row.user);
    return now >= ExpiresAt(row) || user == nullptr || user->edition != row.edition;
  });
}

Result<std::optional<OpenedSession>, std::string> AuthStore::LogIn(const std::string& name,
                                                                   std::string_view password) {
  PasswordHash hash = nobody_;
  std::string edition;
  {
    const std::lock_guard lock(mutex_);
    Look();
    if (const User* user = FindUser(name)) {
      hash = user->password;
      edition = user->edition;
    }
  }
  const bool is_right = IsPassword(hash, password);
  if (!is_right || edition.empty()) return std::optional<OpenedSession>();

  OpenedSession opened;
  opened.token = RandomToken(kTokenBytes);
  const std::int64_t now = Now_utc_ms();
  const Session session{Sha256Hex(opened.token), name, edition, now, now};
  bool is_still_so = true;
  const auto fault =
      Alter(sessions_, [&](std::vector<Session>& rows) -> std::optional<std::string> {
        DropWorthless(rows);
        const User* user = FindUser(name);
        is_still_so = user != nullptr && user->edition == edition;
        if (!is_still_so) return "";
        opened.identity = {name, user->role, false, session.token_sha256, ExpiresAt(session)};
        while (rows.size() >= limits_.sessions) {
          rows.erase(std::min_element(rows.begin(), rows.end(), [](const auto& a, const auto& b) {
            return a.used_utc_ms < b.used_utc_ms;
          }));
        }
        rows.push_back(session);
        return std::nullopt;
      });
  if (!is_still_so) return std::optional<OpenedSession>();
  if (fault) return Failure{*fault};
  return std::optional<OpenedSession>(std::move(opened));
}

std::optional<std::string> AuthStore::LogOut(const std::string& token_sha256) {
  {
    // At once, whatever the disk says.
    const std::lock_guard lock(mutex_);
    std::erase_if(sessions_.rows,
                  [&](const Session& session) { return session.token_sha256 == token_sha256; });
  }
  return Alter(sessions_, [&](std::vector<Session>& rows) -> std::optional<std::string> {
    std::erase_if(rows, [&](const Session& row) { return row.token_sha256 == token_sha256; });
    return std::nullopt;
  });
}

std::optional<Identity> AuthStore::IdentityOf(std::string_view token_sha256) {
  Session* session = FindSession(token_sha256);
  if (session == nullptr) return std::nullopt;
  const User* user = UserOf(*session);
  if (user == nullptr) return std::nullopt;
  session->used_utc_ms = std::max(session->used_utc_ms, Now_utc_ms());
  return Identity{user->name, user->role, false, session->token_sha256, ExpiresAt(*session)};
}

std::optional<Identity> AuthStore::OfSession(std::string_view token) {
  const std::string digest = Sha256Hex(token);
  const std::lock_guard lock(mutex_);
  Look();
  return IdentityOf(digest);
}

std::optional<Identity> AuthStore::OfReadToken(std::string_view token) {
  const std::string digest = Sha256Hex(token);
  const std::lock_guard lock(mutex_);
  Look();
  for (const ReadToken& row : tokens_.rows) {
    if (row.token_sha256 != digest) continue;
    return Identity{row.name, Role::kViewer, true, digest, kReadTokenNeverExpires_utc_ms};
  }
  return std::nullopt;
}

bool AuthStore::StillHolds(const Identity& identity) {
  const std::lock_guard lock(mutex_);
  Look();
  if (!identity.is_token) return IdentityOf(identity.token_sha256).has_value();
  return std::any_of(tokens_.rows.begin(), tokens_.rows.end(), [&](const ReadToken& row) {
    return row.token_sha256 == identity.token_sha256;
  });
}

std::optional<std::string> AuthStore::KeepUses() {
  {
    const std::lock_guard lock(mutex_);
    const std::int64_t now = Now_utc_ms();
    // Also when the clock was set back.
    const std::int64_t since = now - uses_kept_utc_ms_;
    if (since >= 0 && since < Milliseconds(limits_.note_use_every)) return std::nullopt;
    uses_kept_utc_ms_ = now;
    if (sessions_.rows.empty()) return std::nullopt;
  }
  return Alter(sessions_, [&](std::vector<Session>& rows) -> std::optional<std::string> {
    DropWorthless(rows);
    return std::nullopt;
  });
}

std::vector<std::string> AuthStore::TakeFaults() {
  const std::lock_guard lock(mutex_);
  return std::exchange(faults_, {});
}

}  // namespace tbm::hmi
