#include "hmi_bridge/server/tls_files.h"

#include <array>
#include <cstdio>
#include <ctime>
#include <memory>

#include <arpa/inet.h>
#include <fmt/format.h>
#include <openssl/err.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/x509.h>
#include <openssl/x509v3.h>

#include "hmi_bridge/server/origin.h"
#include "hmi_bridge/server/private_folder.h"
#include "hmi_bridge/server/secrets.h"

namespace tbm::hmi {
namespace {

template <auto Free>
struct Freer {
  template <class T>
  void operator()(T* held) const {
    Free(held);
  }
};
using Key = std::unique_ptr<EVP_PKEY, Freer<EVP_PKEY_free>>;
using Certificate = std::unique_ptr<X509, Freer<X509_free>>;
using Extension = std::unique_ptr<X509_EXTENSION, Freer<X509_EXTENSION_free>>;
using Memory = std::unique_ptr<BIO, Freer<BIO_free>>;
struct Close {
  void operator()(std::FILE* file) const { std::fclose(file); }
};
using File = std::unique_ptr<std::FILE, Close>;

constexpr long kDays = 825;  // the most that browsers take

bool IsAddress(const std::string& name) {
  in6_addr bytes = {};
  return inet_pton(AF_INET, name.c_str(), &bytes) == 1 ||
         inet_pton(AF_INET6, name.c_str(), &bytes) == 1;
}

bool AddExtension(X509* certificate, int kind, const std::string& value) {
  X509V3_CTX context = {};
  X509V3_set_ctx_nodb(&context);
  X509V3_set_ctx(&context, certificate, certificate, nullptr, nullptr, 0);
  const Extension extension(X509V3_EXT_conf_nid(nullptr, &context, kind, value.c_str()));
  return extension && X509_add_ext(certificate, extension.get(), -1) == 1;
}

Certificate Sign(EVP_PKEY* key, const std::vector<std::string>& names, const Clock& clock) {
  Certificate certificate(X509_new());
  std::string also;
  for (const std::string& name : names) {
    also += fmt::format("{}{}:{}", also.empty() ? "" : ",", IsAddress(name) ? "IP" : "DNS", name);
  }
  // Of a random number of 159 bits none is there twice, nor negative.
  std::string serial = RandomBytes(20);
  serial[0] = static_cast<char>(serial[0] & 0x7f);
  const std::unique_ptr<BIGNUM, Freer<BN_free>> number(
      BN_bin2bn(reinterpret_cast<const unsigned char*>(serial.data()), 20, nullptr));
  std::time_t now = static_cast<std::time_t>(clock.Now().ns / 1'000'000'000);
  X509* raw = certificate.get();
  X509_NAME* subject = X509_get_subject_name(raw);
  const auto* text = reinterpret_cast<const unsigned char*>("tbm operator's console");
  const bool is_made =
      X509_set_version(raw, 2) == 1 &&
      BN_to_ASN1_INTEGER(number.get(), X509_get_serialNumber(raw)) != nullptr &&
      // A day before: a tablet's clock may be behind.
      X509_time_adj_ex(X509_getm_notBefore(raw), -1, 0, &now) != nullptr &&
      X509_time_adj_ex(X509_getm_notAfter(raw), kDays - 1, 0, &now) != nullptr &&
      X509_NAME_add_entry_by_txt(subject, "CN", MBSTRING_ASC, text, -1, -1, 0) == 1 &&
      X509_set_issuer_name(raw, subject) == 1 && X509_set_pubkey(raw, key) == 1 &&
      AddExtension(raw, NID_basic_constraints, "critical,CA:FALSE") &&
      AddExtension(raw, NID_key_usage, "critical,digitalSignature") &&
      AddExtension(raw, NID_ext_key_usage, "serverAuth") &&
      AddExtension(raw, NID_subject_alt_name, also) && X509_sign(raw, key, EVP_sha256()) > 0;
  if (!is_made) certificate.reset();
  return certificate;
}

std::string TextOf(BIO* memory) {
  char* data = nullptr;
  const long size = BIO_get_mem_data(memory, &data);
  return {data, static_cast<std::size_t>(size)};
}

std::string Fingerprint(const X509* certificate) {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned int size = 0;
  X509_digest(certificate, EVP_sha256(), digest.data(), &size);
  std::string text;
  for (unsigned int i = 0; i < size; ++i) {
    text += fmt::format("{}{:02X}", i == 0 ? "" : ":", digest[i]);
  }
  return text;
}

}  // namespace

Result<SelfSigned, std::string> MakeSelfSigned(const std::string& state_folder,
                                               const std::vector<std::string>& names,
                                               const Clock& clock) {
  if (names.empty()) return Failure{std::string("a certificate needs a name or an address")};
  for (const std::string& name : names) {
    if (!IsAddress(name) && (!HostName(name) || name.find_first_of(":,") != std::string::npos)) {
      return Failure{fmt::format("'{}' is no host's name or address", name)};
    }
  }
  const auto folder = PrivateFolder::Open(state_folder);
  if (!folder) return Failure{folder.error()};
  const Key key(EVP_EC_gen("P-256"));
  const Certificate certificate = key ? Sign(key.get(), names, clock) : nullptr;
  const Memory certificate_text(BIO_new(BIO_s_mem()));
  const Memory key_text(BIO_new(BIO_s_mem()));
  if (!certificate || PEM_write_bio_X509(certificate_text.get(), certificate.get()) != 1 ||
      PEM_write_bio_PrivateKey(key_text.get(), key.get(), nullptr, nullptr, 0, nullptr, nullptr) !=
          1) {
    ERR_clear_error();
    return Failure{std::string("OpenSSL cannot make a certificate")};
  }
  SelfSigned made;
  made.files = {folder->PathOf("certificate.pem"), folder->PathOf("key.pem")};
  made.sha256 = Fingerprint(certificate.get());
  if (auto fault = folder->Write("key.pem", TextOf(key_text.get()))) return Failure{*fault};
  if (auto fault = folder->Write("certificate.pem", TextOf(certificate_text.get()))) {
    return Failure{*fault};
  }
  return made;
}

std::optional<std::string> WhyNotTls(const TlsFiles& files) {
  const File certificate_file(std::fopen(files.certificate_pem.c_str(), "re"));
  if (!certificate_file) {
    return fmt::format("certificate {}: cannot be read", files.certificate_pem);
  }
  const Certificate certificate(PEM_read_X509(certificate_file.get(), nullptr, nullptr, nullptr));
  const File key_file(std::fopen(files.key_pem.c_str(), "re"));
  // An empty pass phrase at hand: OpenSSL would ask the terminal for one.
  char no_phrase[] = "";
  const Key key(key_file ? PEM_read_PrivateKey(key_file.get(), nullptr, nullptr, no_phrase)
                         : nullptr);
  ERR_clear_error();
  if (!certificate) {
    return fmt::format("certificate {}: is no PEM certificate", files.certificate_pem);
  }
  if (!key_file) return fmt::format("key {}: cannot be read", files.key_pem);
  if (!key) return fmt::format("key {}: is no PEM key without a pass phrase", files.key_pem);
  if (X509_check_private_key(certificate.get(), key.get()) != 1) {
    ERR_clear_error();
    return fmt::format(
        "key {} does not belong to certificate {}", files.key_pem, files.certificate_pem);
  }
  return std::nullopt;
}

}  // namespace tbm::hmi
