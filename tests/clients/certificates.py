"""A certificate authority as a lab has one, by the commands of docs/operations.md."""

import pathlib
import subprocess


def openssl(*arguments, at=None):
    """Runs openssl, now or at some other time, for which faketime is needed."""
    at_another_time = ["faketime", at] if at else []
    done = subprocess.run([*at_another_time, "openssl", *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode == 0, "openssl %s: %s" % (" ".join(map(str, arguments)), done.stderr)


class Issued:
    """A certificate and its key."""

    def __init__(self, cert, key):
        self.cert, self.key = cert, key
        self.options = ("--tls-cert", str(cert), "--tls-key", str(key))


class Authority:
    def __init__(self, folder):
        self.folder = pathlib.Path(folder)
        self.file, self.key = self.folder / "ca.pem", self.folder / "ca.key"
        openssl("req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-days", 30,
                "-subj", "/CN=lab authority", "-keyout", self.key, "-out", self.file)

    def issue(self, name, days=10, names="DNS:localhost,IP:127.0.0.1", key=("-newkey", "rsa:2048"), at=None):
        """A certificate for this machine, issued now or at some other time."""
        cert, key_file, asked = (self.folder / (name + end) for end in (".pem", ".key", ".csr"))
        extensions = self.folder / (name + ".ext")
        extensions.write_text("subjectAltName=%s\nextendedKeyUsage=serverAuth\n" % names)
        openssl("req", *key, "-nodes", "-subj", "/CN=" + name, "-keyout", key_file, "-out", asked)
        openssl("x509", "-req", "-in", asked, "-CA", self.file, "-CAkey", self.key, "-CAcreateserial", "-days", days,
                "-extfile", extensions, "-out", cert, at=at)
        return Issued(cert, key_file)
