"""Runs a command while an S3 server of moto with an empty bucket is there, which the command's variables name."""

import os
import subprocess
import sys

import boto3
from moto.server import ThreadedMotoServer

server = ThreadedMotoServer(ip_address="127.0.0.1", port=0)
server.start()
host, port = server.get_host_and_port()
variables = {
    "AWS_ENDPOINT_URL": f"http://{host}:{port}",
    "AWS_ALLOW_HTTP": "true",
    "AWS_REGION": "us-east-1",
    "AWS_ACCESS_KEY_ID": "test",
    "AWS_SECRET_ACCESS_KEY": "test",
}
os.environ.update(variables)
boto3.client("s3", region_name="us-east-1").create_bucket(Bucket="grasp-test")
done = subprocess.run(sys.argv[1:], env={**os.environ, "GRASP_TEST_STORE": "s3://grasp-test/one/server"})
server.stop()
sys.exit(done.returncode)
